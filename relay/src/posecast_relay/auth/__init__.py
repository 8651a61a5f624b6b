"""Who asks, and what they may see: tokens, accounts, addresses and origins, and the policy in force."""
