"""Random hostile stories, flown in virtual time, judged by the truth, and shrunk where they fail."""
