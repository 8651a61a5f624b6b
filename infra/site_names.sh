#!/bin/sh
# site_names.sh: prints what SITE (as in .env) names, one per line and without scheme and port, as a certificate lists it: DNS:NAME or
# IP:ADDRESS.
set -eu
for name in $(echo "${SITE:-localhost}" | tr ',' ' '); do
  # an IPv6 address without brackets has no port
  name=$(echo "$name" | sed -E 's,^[a-z]+://,,; s,^\[(.*)\](:[0-9]+)?$,\1,; s,^([^:]*):[0-9]+$,\1,')
  case $name in
    *:*) echo "IP:$name" ;;
    *[!0-9.]*) echo "DNS:$name" ;;
    *) echo "IP:$name" ;;
  esac
done
