"""Names that are agreed and not applied yet, and what applies them."""
