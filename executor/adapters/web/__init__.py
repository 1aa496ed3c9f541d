"""The page to fly by: a small server in a thread of its own, and the files that a browser is given."""
