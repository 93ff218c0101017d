"""JSON schemas of what programs read: verdict.json and loop.json."""
