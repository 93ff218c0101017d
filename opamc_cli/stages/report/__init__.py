"""Stage `report`: tables and verdict in, one HTML file out."""
