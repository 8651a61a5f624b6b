#!/bin/sh
# start_proxy.sh ARGUMENTS: runs Caddy with the certificate of the first IP address in SITE for browsers that open an address: they
# name no host, and inside a container Caddy can't see which address they used. SITE: as in .env.
set -eu
names=$("$(dirname "$0")/site_names.sh")
DEFAULT_SNI=$(echo "$names" | sed -n 's/^IP://p' | head -n 1)
export DEFAULT_SNI="${DEFAULT_SNI:-localhost}"
NAMES=$(echo "$names" | sed -E 's/^(IP|DNS)://' | tr '\n' ' ')
export NAMES # without schemes and ports, to compare with what a request names
exec caddy run "$@"
