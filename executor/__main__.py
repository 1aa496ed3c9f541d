"""`python -m executor` is `faultline`."""

from faultline_start import main

if __name__ == "__main__":
    main()
