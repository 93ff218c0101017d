"""What these tests share is found from the folders below it, too."""
