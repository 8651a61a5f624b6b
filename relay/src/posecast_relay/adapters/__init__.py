"""What touches the world: Zenoh in, WebSocket out, stores, models. They ask the core and do what it says."""
