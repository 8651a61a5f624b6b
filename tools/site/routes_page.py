"""The page about the relay's routes, generated from its /openapi.json."""

from __future__ import annotations

import inspect
import json
from collections.abc import Iterator, Mapping
from typing import Any, cast

from posecast_relay.http.app import make_app

Described = Mapping[str, Any]

HEAD = """# Routes

Every HTTP route of a relay, generated from its `/openapi.json`. Each relay shows the same at `/docs/`,
where you can try the routes. For examples see [the protocol](protocol.md), which also describes the WebSocket
`/api/v1/robots/{robot}/live`.
"""
UNSAID = "Successful Response"  # FastAPI's default text
SCHEMAS = "#/components/schemas/"


def write_routes(document: Described) -> str:
    """The page for an OpenAPI document."""
    lines = [HEAD]
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            lines += [*_write_route(method.upper(), path, operation), ""]
    lines += ["## Documents", ""]
    for name, schema in document["components"]["schemas"].items():
        lines += [*_write_schema(name, schema), ""]
    return "\n".join(lines)


def read_description() -> Described:
    """The /openapi.json with all routes that a relay may have."""
    # only described, never called: the dummies are not used
    nothing = cast("Any", _Nothing())
    return make_app(nothing, nothing, nothing, None, past=nothing, admin=nothing).openapi()


class _Nothing:
    """A dummy for everything behind the routes."""

    def __getattr__(self, name: str) -> _Nothing:
        return _Nothing()

    def __call__(self, *_: object) -> _Nothing:
        return _Nothing()


def _write_route(method: str, path: str, operation: Described) -> Iterator[str]:
    title, _, more = operation["summary"].partition(": ")
    yield f"## {title}"
    yield ""
    yield f"`{method} {path}`" + (f": {more}." if more else "")
    yield ""
    parameters = [each for each in operation.get("parameters", ()) if each["in"] == "query"]
    if parameters:
        names = (f"`{each['name']}`" + _write_default(each["schema"]) for each in parameters)
        yield f"Query: {', '.join(names)}."
        yield ""
    yield "| status | answer |"
    yield "|---|---|"
    for status, answer in sorted(operation["responses"].items()):
        kinds = [_write_content(media, told["schema"]) for media, told in answer.get("content", {}).items()]
        body = "; ".join(filter(None, [answer["description"].replace(UNSAID, ""), *kinds]))
        yield f"| {'refused' if status == 'default' else status} | {body} |"


def _write_default(schema: Described) -> str:
    default = schema.get("default")
    return f" (default `{default}`)" if default not in (None, "") else ""


def _write_content(media: str, schema: Described) -> str:
    if schema.get("format") == "binary" or schema.get("type") == "string":
        return f"`{media}`"
    kind = _write_type(schema)
    return f"`{media}`: {kind}" if kind else ""


def _write_schema(name: str, schema: Described) -> Iterator[str]:
    yield f"### {name}"
    yield ""
    yield inspect.cleandoc(schema.get("description", ""))
    yield ""
    required = set(schema.get("required", ()))
    if schema.get("properties"):
        yield "| member | type | presence |"
        yield "|---|---|---|"
        for member, told in schema["properties"].items():
            note = "always" if member in required else "optional"
            yield f"| `{member}` | {_write_type(told)} | {note} |"


def _write_type(schema: Described) -> str:
    """A type in words, with links to other documents."""
    if "$ref" in schema:
        name = schema["$ref"].removeprefix(SCHEMAS)
        return f"[{name}](#{name.lower()})"
    if "anyOf" in schema:
        return " or ".join(map(_write_type, schema["anyOf"]))
    if "const" in schema or "enum" in schema:
        return " or ".join(f"`{json.dumps(value)}`" for value in schema.get("enum", [schema.get("const")]))
    kind = str(schema.get("type", "any value"))
    if "prefixItems" in schema:
        kind = f"{len(schema['prefixItems'])} × {_write_type(schema['prefixItems'][0])}"
    elif kind == "array":
        kind = f"list of {_write_type(schema['items'])}"
    elif isinstance(schema.get("additionalProperties"), dict):
        kind = f"by name: {_write_type(schema['additionalProperties'])}"
    return kind
