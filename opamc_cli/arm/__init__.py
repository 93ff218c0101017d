"""The links of an arm: what they ask of each joint, and where the joints are."""
