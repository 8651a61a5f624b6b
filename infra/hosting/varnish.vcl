# A cache for a crowd: Varnish 7 in front of a relay. It serves the lane (segments of the past, and models) and refuses everything else:
# no sockets, no page, no list of robots. It speaks HTTP only: something before it ends TLS (Caddy, nginx, hitch).
#   varnishd -f /etc/varnish/varnish.vcl -a :6081 -s malloc,1g -s Transient=malloc,64m -p timeout_idle=10 -p idle_send_timeout=15 -p send_timeout=120
#   posecast-relay run --trusted-proxies ADDRESS-OF-THIS-MACHINE …
vcl 4.1;

# change this
backend relay {
	.host = "127.0.0.1"; # resolved when Varnish starts
	.port = "8080";
	.connect_timeout = 2s;
	.first_byte_timeout = 15s; # the relay holds a request for the next segment for 8 s
	.between_bytes_timeout = 15s;
}

sub vcl_recv {
	# requests that no page sends: refuse them and close the connection
	if (req.http.Transfer-Encoding || req.http.Content-Length ~ "[1-9]") {
		return (synth(400, "requests have no body here"));
	}
	if (req.method != "GET" && req.method != "HEAD" && req.method != "OPTIONS") {
		return (synth(400, "only GET, HEAD and OPTIONS are answered here"));
	}
	if (req.url ~ "#") {
		return (synth(400, "an address is sent without what follows its #"));
	}
	if (req.url !~ "^/api/v1/robots/[a-z0-9-]+/(past($|\?|/)|model/)") {
		return (synth(404, "this is a cache of segments and models"));
	}
	if (req.url ~ "(?i)[?&](access_)?token(=|&|$)") {
		return (synth(400, "a token never stands in an address: send it as Authorization"));
	}
	unset req.http.Cookie;
	unset req.http.Range; # send a segment in one piece
	# Each address is written in only one way: other spellings would be additional cache keys for the same answer. Model names may
	# contain spaces and letters of any language, which pages encode with encodeURIComponent. Made-up parameters would also be cache
	# keys. A day, a segment, a schema and a model have none; anything else that no page requests passes through uncached.
	if (req.url ~ "^/api/v1/robots/[a-z0-9-]+/past[^?]*[^A-Za-z0-9_:/?-]") {
		return (synth(404, "not here, or not for you"));
	}
	if (req.url ~ "^[^?]*/past/[^/?]+/([0-9-]+|[0-9a-f]{16}/[0-9]+|schema/[0-9a-f]{64})\?|^[^?]*/model/" || req.url ~ "^[^?]*\?$") {
		set req.url = regsub(req.url, "\?.*$", "");
	}
	if (req.url ~ "^[^?]*/model/" &&
	    req.url !~ "/model/[0-9a-f]{64}/([A-Za-z0-9_.~/-]|%20|%2[BC]|%3D|%40|%[89A-F][0-9A-F])+$") {
		return (synth(404, "not here, or not for you"));
	}
	if (req.url ~ "^[^?]*/keys\?every=[0-9]{4}" && req.url !~ "=1000$") {
		return (synth(400, "every: want a number from 1 to 1000, without leading zeros"));
	}
	if (req.url ~ "^[^?]*/keys\?every=1$") {
		set req.url = regsub(req.url, "\?.*$", "");
	}
	if (req.url ~ "^[^?]*/keys\?every=(15[1-9]|1[6-9][0-9]|[2-9][0-9][0-9]|1000)$") {
		set req.url = regsub(req.url, "=.*$", "=150"); # the relay has no further steps
	}
	# requests with a token are neither answered from the cache nor cached
	if (req.method == "OPTIONS" || req.http.Authorization ||
	    (req.url ~ "\?" && req.url !~ "^[^?]*/past\?view=[A-Za-z0-9_-]+$" &&
	     req.url !~ "^[^?]*Z\?after=[0-9a-f]{16}(,|%2C)[0-9]{1,10}$" && req.url !~ "^[^?]*/keys\?every=[1-9][0-9]{0,2}$")) {
		return (pass);
	}
	return (hash);
}

sub vcl_synth {
	if (resp.status == 400) {
		set resp.http.Connection = "close";
	}
	set resp.http.Content-Type = "application/json";
	set resp.http.Cache-Control = "private, no-store";
	set resp.http.Access-Control-Allow-Origin = "*";
	set resp.body = """{"error": """ + {"""} + resp.reason + """"}""";
	return (deliver);
}

sub vcl_hash {
	hash_data(req.url); # whatever host name this cache was addressed by
	return (lookup);
}

sub vcl_backend_response {
	if (bereq.uncacheable) {
		return (deliver);
	}
	# Stale answers are not sent: clients wait with the one whose request is at the relay, and hear of news at once.
	set beresp.grace = 0s;
	set beresp.keep = 0s;
	if (beresp.status >= 400) {
  # Without a token, all are refused alike. The refusal is kept for a second, so that a crowd asks once; by default Varnish would
  # let everybody through to the relay for the next 120 s.
		set beresp.ttl = 1s;
	} else if (beresp.http.Set-Cookie || beresp.http.Cache-Control !~ "public") {
		set beresp.uncacheable = true;
		set beresp.ttl = 1s;
	}
	return (deliver);
}

sub vcl_backend_error {
	set beresp.ttl = 1s; # if the relay does not answer, one request tries it, not all waiting ones
	set beresp.grace = 0s;
	set beresp.http.Cache-Control = "public, max-age=1";
	set beresp.http.Retry-After = "1";
	set beresp.http.Vary = "authorization";
	set beresp.http.Access-Control-Allow-Origin = "*";
	set beresp.http.Access-Control-Expose-Headers = "age, date, etag, retry-ms, retry-after";
	set beresp.body = """{"error": "the relay does not answer: ask again"}""";
	set beresp.http.Content-Type = "application/json";
	return (deliver);
}

sub vcl_deliver {
	if (obj.hits > 0) {
		set resp.http.X-Cache = "HIT";
	} else {
		set resp.http.X-Cache = "MISS";
	}
	unset resp.http.Via;
	unset resp.http.X-Varnish;
}
