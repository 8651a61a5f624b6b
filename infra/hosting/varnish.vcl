# A cache for a crowd: Varnish (7) before a relay. It serves the lane (segments of the past, and models) and refuses all else:
# no sockets, no page, no list of robots. It speaks HTTP only: something before it ends TLS (Caddy, nginx, hitch).
#   varnishd -f /etc/varnish/varnish.vcl -a :6081 -s malloc,1g -s Transient=malloc,64m -p timeout_idle=75
#   posecast-relay run --trusted-proxies ADDRESS-OF-THIS-MACHINE …
vcl 4.1;

# yours
backend relay {
	.host = "127.0.0.1"; # looked up when Varnish starts
	.port = "8080";
	.connect_timeout = 2s;
	.first_byte_timeout = 15s; # the relay holds a request for the next segment for 8 s
	.between_bytes_timeout = 15s;
}

sub vcl_recv {
	if (req.url !~ "^/api/v1/robots/[a-z0-9-]+/(past($|\?|/)|model/)") {
		return (synth(404));
	}
	unset req.http.Cookie;
	unset req.http.Range; # a segment is sent whole
	# The past is written in one way only: other spellings would be further names for one answer. So would made-up parameters:
	# a day, a segment and a schema have none; what else no page asks for passes, unkept.
	if (req.url ~ "^/api/v1/robots/[a-z0-9-]+/past[^?]*%") {
		return (synth(404));
	}
	if (req.url ~ "^[^?]*/past/[^/?]+/([0-9-]+|[0-9a-f]{16}/[0-9]+|schema/[0-9a-f]{64})\?") {
		set req.url = regsub(req.url, "\?.*$", "");
	}
	# who shows a token is not answered from what is kept, and nothing of theirs is kept
	if ((req.method != "GET" && req.method != "HEAD") || req.http.Authorization ||
	    (req.url ~ "\?" && req.url !~ "/past\?view=[A-Za-z0-9_-]+$" &&
	     req.url !~ "Z\?after=[0-9a-f]{16}(,|%2C)[0-9]{1,10}$" && req.url !~ "/keys\?every=[1-9][0-9]{0,3}$")) {
		return (pass);
	}
	return (hash);
}

sub vcl_hash {
	hash_data(req.url); # by whatever host name this cache was asked
	return (lookup);
}

sub vcl_backend_response {
	if (bereq.uncacheable) {
		return (deliver);
	}
	# What is too old is not sent: who asks meanwhile waits with the one who asks the relay, and hears at once when there is more.
	set beresp.grace = 0s;
	set beresp.keep = 0s;
	if (beresp.status >= 400) {
		# Without a token all are refused alike. Kept for a second, so that a crowd asks once; Varnish would by itself let
		# everybody go to the relay for the next 120 s.
		set beresp.ttl = 1s;
	} else if (beresp.http.Set-Cookie || beresp.http.Cache-Control !~ "public") {
		set beresp.uncacheable = true;
		set beresp.ttl = 1s;
	}
	return (deliver);
}

sub vcl_backend_error {
	set beresp.ttl = 1s; # a relay that does not answer is asked by one, not by all who wait
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
