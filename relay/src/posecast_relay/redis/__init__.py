"""Redis: the newest state of every robot, between relays that receive it and gateways that serve it."""
