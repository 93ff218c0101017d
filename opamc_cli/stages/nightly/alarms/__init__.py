"""From the verdicts of many nights to alarms, and to what is worth saying in the morning."""
