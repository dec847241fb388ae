"""tubecert: certified tracking tubes for control-affine systems with matched uncertainty."""

__version__ = "0.1.0"
