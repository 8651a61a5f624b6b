"""Settings: flags over variables over defaults; a wrong value is one line."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from posecast_relay.config.settings import CHECKOUT, FLAGS, PLACES, SettingsError, find_page, parse
from posecast_relay.core.hub import FORGET_FULL_S
from posecast_relay.core.limits import Limits
from posecast_relay.server.past import make_past_services

from .operator_pages import DOCS, PAGES


def test_defaults() -> None:
    settings = parse(["run", "--dev"], {})
    assert (settings.host, settings.port, settings.store) == ("127.0.0.1", 8080, "memory://")
    assert settings.zenoh_listen == ("tcp/127.0.0.1:7447",)
    assert settings.metrics_port is None
    assert settings.max_connection_age is None


def test_a_flag_wins_over_its_variable_and_that_over_port() -> None:
    environ = {"POSECAST_PORT": "9001", "PORT": "9002", "POSECAST_DEV": "1"}
    assert parse(["run"], environ).port == 9001
    assert parse(["run", "--port", "9000"], environ).port == 9000
    assert parse(["run"], {"PORT": "9002", "POSECAST_DEV": "1"}).port == 9002
    assert parse(["run"], {"PORT": "", "POSECAST_DEV": "1"}).port == 8080


@pytest.mark.parametrize(
    ("argv", "environ", "says"),
    [
        ([], {}, "required: run"),
        (["run"], {}, "give --robots FILE (who can publish and watch), or --dev"),
        (["run", "--dev", "--prot", "1"], {}, "unrecognized arguments: --prot (did you mean --port?)"),
        (["run", "--dev", "--port"], {}, "--port"),
        (["run", "--dev", "--port", "80a"], {}, "--port '80a': use a number from 0 to 65535"),
        (["run", "--dev"], {"POSECAST_PORT": "70000"}, "POSECAST_PORT '70000': "),
        (["run", "--dev"], {"PORT": "x"}, "PORT 'x': "),
        (["run"], {"POSECAST_DEV": "perhaps"}, "POSECAST_DEV 'perhaps': use 1 or 0"),
        (["run", "--dev", "--store", "mysql://x"], {}, "--store 'mysql://x': "),
        (
            ["run", "--dev", "--static", "/nowhere"],
            {},
            "--static '/nowhere': use a folder that contains index.html",
        ),
        (["run", "--dev", "--zenoh-listen", "7447"], {}, "--zenoh-listen '7447': use tls/HOST:PORT or tcp"),
        (["run", "--dev", "--zenoh-listen", "tcp/127.0.0.1:99999"], {}, "use tls/HOST:PORT"),
        (["run", "--dev", "--zenoh-listen", "tcp/0.0.0.0:7447"], {}, "allows only tcp/… on loopback"),
        (["run", "--dev", "--zenoh-listen", "tcp/relay.example:7447"], {}, "on loopback"),
        (["run", "--dev", "--max-viewers", "0"], {}, "--max-viewers '0': "),
        (
            ["run", "--dev", "--max-connection-age", "0.5"],
            {},
            "--max-connection-age '0.5': use a number of s",
        ),
        (["run", "--dev", "--past", "30m"], {}, "--past '30m': use memory: or 0"),
        (["run", "--dev", "--past-memory", "8M"], {}, "--past-memory '8M': use a size from 16M to 1024G; "),
        (
            ["run", "--dev", "--past-memory", "64MB"],
            {},
            "--past-memory '64MB': use a size from 16M to 1024G; the",
        ),
        (["run", "--dev", "--host", "a b"], {}, "--host 'a b': "),
        (["run", "--dev", "--trusted-proxies", "10.0.0"], {}, "--trusted-proxies '10.0.0': use addresses"),
        (
            ["run", "--dev", "--origins", "good.com"],
            {},
            "--origins 'good.com': use origins like https://HOST",
        ),
        (
            ["run", "--dev", "--origins", "https://a.b/c"],
            {},
            "--origins 'https://a.b/c': use origins like https://HOST",
        ),
        (["run", "--dev", "--origins", "https://a.b;script-src"], {}, "use origins like https://HOST[:PORT]"),
        (["run", "--robots", __file__, "--zenoh-ca", __file__], {}, "--zenoh-ca needs tls/… or quic/…"),
        (["run", "--dev", "--firebase-project", "X"], {}, "--firebase-project 'X': use the project's id"),
        (["run", "--dev", "--firebase-database", "http://x.firebaseio.com"], {}, "use https://HOST"),
        (["run", "--dev", "--firebase-database", "https://x.example/y"], {}, "use https://HOST"),
        (
            ["run", "--dev", *("--role", "gateway", "--store", "redis://h:1")],
            {"POSECAST_FIREBASE_DATABASE": "https://x.firebaseio.com"},
            "--firebase-database: not with --role gateway",
        ),
        (
            ["run", "--robots", __file__],
            {"FIREBASE_AUTH_EMULATOR_HOST": "127.0.0.1:9099"},
            "FIREBASE_AUTH_EMULATOR_HOST is set: it accepts unsigned tokens, so it needs --dev",
        ),
    ],
)
def test_wrong_settings_are_one_line(argv: list[str], environ: dict[str, str], says: str) -> None:
    with pytest.raises(SettingsError) as error:
        parse(argv, environ)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("argv", "environ", "where"),
    [
        (["--workers", "4"], {"POSECAST_WORKERS": "1"}, "--workers '4'"),
        (["--workers", "0"], {}, "--workers '0'"),
        ([], {"POSECAST_WORKERS": "4"}, "POSECAST_WORKERS '4'"),
    ],
)
def test_more_workers_are_refused_with_what_to_use_instead(
    argv: list[str], environ: dict[str, str], where: str
) -> None:
    with pytest.raises(SettingsError) as error:
        parse(["run", *argv], environ)
    says = "removed, leave it out; for more cores or machines, run gateways: the relay and each gateway with "
    how = "the same --store redis://…, gateways with --role gateway (docs/how-to/scale/gateways.md)"
    assert str(error.value) == f"{where}: {says}{how}"
    assert (Path(__file__).parents[2] / "docs/how-to/scale/gateways.md").exists()


def test_one_worker_which_old_scripts_and_compose_files_set_is_what_a_relay_is() -> None:
    plain = parse(["run", "--dev"], {})
    assert parse(["run", "--dev", "--workers", "1"], {"POSECAST_WORKERS": "4"}) == plain
    for text in ("1", ""):
        assert parse(["run", "--dev"], {"POSECAST_WORKERS": text}) == plain


def test_several_listeners_and_a_static_folder(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("x")
    argv = ["run", "--dev", "--zenoh-listen", "tcp/127.0.0.1:0, tcp/[::1]:7447", "--static", str(tmp_path)]
    settings = parse(argv, {})
    assert settings.zenoh_listen == ("tcp/127.0.0.1:0", "tcp/[::1]:7447")
    assert settings.static == tmp_path


def test_help_lists_every_setting(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        parse(["run", "--help"], {})
    assert stop.value.code == 0
    said = capsys.readouterr().out
    for name in (
        "--dev",
        "--host",
        "--port",
        "--store",
        "--zenoh-listen",
        "--static",
        "POSECAST_MAX_VIEWERS",
    ):
        assert name in said
    assert "workers" not in said


def test_a_gateway_needs_no_publishers_and_every_role_but_all_a_store() -> None:
    found = parse(["run", "--dev", "--role", "gateway", "--store", "redis+cluster://h:1"], {})
    assert (found.role, found.store) == ("gateway", "redis+cluster://h:1")
    assert parse(["run", "--dev"], {"POSECAST_ROLE": "all"}).role == "all"
    with pytest.raises(SettingsError, match="give --robots FILE"):
        parse(["run", "--role", "gateway", "--store", "redis://h:1"], {})
    for role in ("ingest", "gateway"):
        with pytest.raises(SettingsError, match=f"--role {role}: needs --store redis"):
            parse(["run", "--dev", "--role", role], {})
    with pytest.raises(SettingsError, match="--role 'edge': use all, ingest or gateway"):
        parse(["run", "--role", "edge"], {})


def test_the_past_is_kept_in_an_object_store() -> None:
    for url in ("file:///srv/past", "s3://bucket/below", "gs://bucket", "az://box/x"):
        assert parse(["run", "--dev", "--past", url], {}).archive == url
    assert parse(["run", "--dev"], {}).archive is None
    assert parse(["run", "--dev", "--past", "0"], {}).archive is None
    for wrong in ("s3:bucket", "s3://key:secret@bucket/x"):
        with pytest.raises(SettingsError, match="use memory: or 0, or for an object store file:///FOLDER"):
            parse(["run", "--dev", "--past", wrong], {})
    with pytest.raises(SettingsError, match=r"^--past '/srv/past': write file:///srv/past$"):
        parse(["run", "--dev", "--past", "/srv/past"], {})


def test_the_past_is_kept_in_memory_or_not_at_all() -> None:
    kept = parse(["run", "--dev"], {"POSECAST_PAST": "memory:"})
    assert (kept.past, kept.past_memory) == ("memory:", 256 << 20)
    assert make_past_services(kept).source is not None
    assert parse(["run", "--dev", "--past-memory", "2G"], {}).past_memory == 2 << 30
    assert make_past_services(parse(["run", "--dev"], {})).source is not None
    assert make_past_services(parse(["run", "--dev", "--past", "0"], {})).source is None
    gateway = ["run", "--dev", "--role", "gateway", "--store", "redis://localhost"]
    services = make_past_services(parse(gateway, {}))
    assert services.recorder is None  # it reads


# ---- which page a relay serves when nobody names one ---------------------------------


def test_the_page_in_the_package_comes_before_that_of_the_checkout(tmp_path: Path) -> None:
    packed, built = tmp_path / "page", tmp_path / "dist"
    for folder in (packed, built):
        folder.mkdir()
    assert find_page((packed, built)) is None  # a folder alone is no page
    (built / "index.html").touch()
    assert find_page((packed, built)) == built
    (packed / "index.html").touch()
    assert find_page((packed, built)) == packed


def test_the_checkout_is_this_one() -> None:
    assert Path(__file__).resolve().parents[2] == CHECKOUT
    assert PLACES[1] == CHECKOUT / "spa/dist"


# ---- docs/reference/settings.md --------------------------------------------------------


PAGE = (DOCS / "reference/settings.md").read_text(encoding="utf-8")
FLAG = re.compile(r"(?<![\w-])--[a-z][a-z-]+")
RELAY = {flag.option for flag in FLAGS} | {"--help"}
COMMANDS = {  # of `posecast-relay robots` and `past`
    *("--all", "--anyone", "--begin", "--ca", "--certificate", "--days", "--finish", "--from", "--keep"),
    *("--link", "--networks", "--private", "--signed-in", "--to", "--url", "--view", "--yes"),
}
EDGE = {
    *("--credential", "--hz", "--proxy", "--relay", "--relay-name", "--robot", "--source"),
    *("--tls-ca", "--tls-cert", "--tls-key"),
}
REDIS_CLI = {"--latency", "--pattern", "--scan"}
OTHERS = {  # docker, docker compose, kubectl, gcloud, rsync and tar
    *("--cap-drop", "--cert", "--delete", "--detach", "--env-file", "--exclude", "--format", "--from-file"),
    *("--force", "--from-literal", "--interactive", "--key", "--name", "--network", "--no-deps"),
    *(
        "--no-recreate",
        "--no-start",
        "--numeric-owner",
        "--profile",
        "--project-name",
        "--quiet",
        "--raw",
        "--read-only",
    ),
    *("--region", "--restart", "--rm", "--scale", "--security-opt", "--tail", "--target", "--tmpfs"),
    *("--user", "--volume", "--volumes", "--wait"),
}


def test_every_setting_has_a_row_with_its_default() -> None:
    rows = re.findall(r"^\| `(--[a-z-]+)(?: (\S+))?` \| (\S+) \|", PAGE, re.MULTILINE)
    assert {(option, kind or None, default.strip("`")) for option, kind, default in rows} == {
        (flag.option, flag.metavar, flag.default or "–") for flag in FLAGS
    }
    assert len(rows) == len(FLAGS)


def test_robots_that_have_left_keep_their_places_as_long_as_it_says() -> None:
    (row,) = re.findall(r"^\| `--max-robots .*$", PAGE, re.MULTILINE)
    assert (Limits().forget_s, FORGET_FULL_S) == (3600, 5)
    assert "an hour after it went offline; if all places are taken, after 5 s" in row


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_flag_exists(page: Path) -> None:
    found = set(FLAG.findall(page.read_text(encoding="utf-8")))
    assert found <= RELAY | COMMANDS | EDGE | REDIS_CLI | OTHERS
