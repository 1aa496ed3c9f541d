"""What vehicles say, into what is known of them."""
