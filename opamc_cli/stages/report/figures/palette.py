"""Colours of the report, each for a light and a dark page.

Blue and orange tell baseline from target for all common colour blindness (Okabe and Ito, 2008);
states carry a word and a sign beside their colour. Text on its page has a contrast of at least 4.5.
"""

from types import MappingProxyType

PALETTE = MappingProxyType(
    {
        "paper": ("#fdfdfc", "#14181d"),
        "panel": ("#f3f4f2", "#1d232a"),
        "ink": ("#1a1f26", "#e6e9ec"),
        "muted": ("#56606c", "#a3adb8"),
        "grid": ("#d6dade", "#3a434d"),
        "baseline": ("#0b69a3", "#62b6ee"),
        "target": ("#b65009", "#f6a15c"),
        "healthy": ("#0a7359", "#45c9a0"),
        "changed": ("#8a6100", "#e9bb42"),
        "fault": ("#b0241c", "#ff8b7d"),
        "unknown": ("#55606d", "#a4aeb9"),
    }
)
"""Role to (light, dark) colour."""

STATE_ROLES = MappingProxyType(
    {"healthy": "healthy", "changed": "changed", "fault": "fault", "insufficient-data": "unknown"}
)
STATE_SIGNS = MappingProxyType(
    {"healthy": "✓", "changed": "▲", "fault": "✕", "insufficient-data": "?"}
)


def colour(role: str) -> str:
    """Return the colour that stands for a role while a figure is drawn."""
    return PALETTE[role][0]


def state_role(state: str) -> str:
    """Return the colour role of a verdict's state."""
    return STATE_ROLES.get(state, "unknown")


def state_sign(state: str) -> str:
    """Return the sign that goes with a state, for eyes and printers without colour."""
    return STATE_SIGNS.get(state, "?")


def custom_properties() -> str:
    """Return the CSS that declares every role: light, dark, and light again on paper."""
    light = " ".join(f"--{role}: {pair[0]};" for role, pair in PALETTE.items())
    dark = " ".join(f"--{role}: {pair[1]};" for role, pair in PALETTE.items())
    return (
        f":root {{ color-scheme: light dark; {light} }}\n"
        f"@media screen and (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}"
    )
