"""The version of this release: read by what is recorded, kept and shown, and by the build."""

__version__ = "0.2.0"
