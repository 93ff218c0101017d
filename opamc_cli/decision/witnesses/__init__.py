"""What each witness says of how far sessions lie apart."""
