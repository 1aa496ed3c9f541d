"""`python -m executor` is `faultline`."""

from executor.cli import main

if __name__ == "__main__":
    main()
