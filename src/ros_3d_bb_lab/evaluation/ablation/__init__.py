"""What each mechanism of estimation and tracking is worth."""
