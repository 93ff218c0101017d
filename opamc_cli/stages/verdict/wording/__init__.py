"""What a verdict says of a joint in words: what to do first, reasons, causes."""
