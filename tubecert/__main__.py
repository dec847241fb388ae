"""`python -m tubecert`."""

from tubecert.cli import main

if __name__ == "__main__":
    main()
