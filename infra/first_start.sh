#!/bin/sh
# first_start.sh: creates the secrets and configuration of a cloud if they don't exist. They are stored in two volumes only:
# /secret (Redis's password, certificates; mounted read-only in relays) and /robots (who may publish). SITE: the names under which
# robots reach the relay, as in .env.
set -eu
umask 027
names=$("$(dirname "$0")/site_names.sh")
cd "${SECRET_FOLDER:-/secret}"

if [ ! -s store ]; then
  word=$(python3 -c 'import secrets; print(secrets.token_urlsafe(32))')
  echo "requirepass $word" > redis.conf
  echo "redis://:$word@redis:6379/0" > store
fi

key="-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes"
if [ ! -s ca.pem ]; then
  # shellcheck disable=SC2086
  openssl req -x509 $key -days 3650 -subj "/CN=Posecast, this cloud's own" -keyout ca.key -out ca.new 2>/dev/null
  mv ca.new ca.pem
fi
alternatives="DNS:relay,$(echo "$names" | paste -sd, -)"
wanted="subjectAltName=$alternatives
basicConstraints=CA:FALSE"
if [ ! -s relay.pem ] || [ "$(cat names 2>/dev/null)" != "$wanted" ]; then
  echo "$wanted" > names
  # shellcheck disable=SC2086
  openssl req $key -subj /CN=relay -keyout relay.key -out asked.pem 2>/dev/null
  openssl x509 -req -in asked.pem -days 3650 -CA ca.pem -CAkey ca.key -set_serial "0x$(openssl rand -hex 8)" \
    -extfile names -out relay.new 2>/dev/null
  mv relay.new relay.pem
  rm asked.pem
fi

export POSECAST_ROBOTS="${ROBOTS_FOLDER:-/robots}/robots.toml"
if [ ! -s demo.credential ]; then
  [ ! -e "$POSECAST_ROBOTS" ] || posecast-relay robots remove demo || true
  posecast-relay robots add demo --ca ca.pem > demo.new
  chmod 600 demo.new
  mv demo.new demo.credential
fi
