"""From a joint's nights to a trend and an alarm; numpy in, numpy out."""
