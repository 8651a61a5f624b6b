"""Who may see what: rules by robot and audience, and share links."""
