#!/usr/bin/env bash
# base_images.sh: the base images that infra/ asks for, made of Debian's packages under the very same names, where they
# are not there and can't be pulled. For the tests only: a site pulls the real ones.
set -euo pipefail
cd "$(dirname "$0")/../.."
missing=()
for image in node:22-bookworm-slim python:3.11-slim-bookworm caddy:2 redis:7 nginx:1 prom/prometheus:v3.5.0; do
  docker image inspect "$image" >/dev/null 2>&1 || timeout 20 docker pull --quiet "$image" >/dev/null 2>&1 || missing+=("$image")
done
[ ${#missing[@]} -gt 0 ] || exit 0
echo "made of Debian's packages, because they can't be pulled: ${missing[*]}"
tools/need mmdebstrap
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
packages=ca-certificates,python3,python3-venv,python3-dev,g++,redis-server,wget,curl,nginx-light,libnginx-mod-stream,prometheus
mmdebstrap --quiet --variant=minbase --include=$packages bookworm "$root/debian"
# how this machine reaches its package registries, for the builds
for file in /etc/ssl/certs/ca-certificates.crt /etc/pip.conf /etc/npmrc; do
  [ ! -e "$file" ] || cp -L --remove-destination "$file" "$root/debian$file"
done
roots=/etc/ssl/certs/ca-certificates.crt
local=$root/debian/usr/local
mkdir -p "$local/bin" "$local/etc" "$local/lib/node_modules"
[ ! -e ~/.npmrc ] || cp -L ~/.npmrc "$local/etc/npmrc" # for everybody there
cp -L "$(command -v node)" "$local/bin/node"
cp .venv/bin/caddy "$root/debian/usr/bin/caddy"
cp -r "$(npm root -g)/npm" "$local/lib/node_modules/"
install -d -o 65534 -g 65534 "$root/debian/prometheus" # as in the real image, so that a volume there is its user's
ln -s ../lib/node_modules/npm/bin/npm-cli.js "$local/bin/npm"
tar -C "$root/debian" -c . | docker import --change "ENV SSL_CERT_FILE=$roots NODE_EXTRA_CA_CERTS=$roots" - "${missing[0]}" >/dev/null
for image in "${missing[@]:1}"; do docker tag "${missing[0]}" "$image"; done
