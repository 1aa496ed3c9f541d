"""Pages and schemas of the documents that are made from the program."""
