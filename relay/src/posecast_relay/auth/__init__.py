"""Finds who is asking and what they may see: tokens, accounts, addresses, origins and the present policy."""
