"""The part of S3 that a study needs, after Amazon's API reference: objects, listings, and writes on conditions.

Objects are written on ``If-None-Match: *`` and ``If-Match`` one after the other, so that of several writers one alone
succeeds. Signatures are not checked, but whose they are is.
"""

import hashlib
import re
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, unquote, urlsplit
from xml.etree import ElementTree
from xml.sax.saxutils import escape

#: An answer: status, headers, content.
Answer = tuple[int, dict[str, str], bytes]
Query = dict[str, list[str]]
#: Who is let in.
USER = "tester"
#: What must be found nowhere.
SECRET = "not-to-be-told-c0ffee"
#: Answers by code: status and words.
REFUSALS = {
    "InvalidAccessKeyId": (403, "The AWS Access Key Id you provided does not exist in our records."),
    "NoSuchBucket": (404, "The specified bucket does not exist"),
    "NoSuchKey": (404, "The specified key does not exist."),
    "PreconditionFailed": (412, "At least one of the pre-conditions you specified did not hold"),
    "NotImplemented": (501, "A header or query you provided implies functionality that is not implemented."),
}


class Refused(Exception):
    """A request is answered with an error, by its code."""


@dataclass(frozen=True)
class Object:
    """An object: content, and when it was written by the server's clock."""

    content: bytes
    written: datetime

    @property
    def tag(self) -> str:
        """The tag that stands for this content."""
        return f'"{hashlib.md5(self.content).hexdigest()}"'


@dataclass
class Buckets:
    """Objects by bucket and key.

    ahead: how far the server's clock goes before that of this machine; careless: conditions that are not kept to.
    """

    kept: dict[str, dict[str, Object]] = field(default_factory=dict)
    ahead: timedelta = timedelta(0)
    careless: frozenset[str] = frozenset()
    lock: threading.Lock = field(default_factory=threading.Lock)

    def bucket(self, name: str) -> dict[str, Object]:
        """Return the objects of a bucket."""
        if name not in self.kept:
            raise Refused("NoSuchBucket")
        return self.kept[name]

    def object(self, bucket: str, key: str) -> Object:
        """Return an object."""
        if key not in self.bucket(bucket):
            raise Refused("NoSuchKey")
        return self.bucket(bucket)[key]

    def put(self, bucket: str, key: str, content: bytes, match: str | None, none_match: str | None) -> Object:
        """Write an object on the conditions of the request."""
        with self.lock:
            there = self.bucket(bucket).get(key)
            match = None if "If-Match" in self.careless else match
            none_match = None if "If-None-Match" in self.careless else none_match
            if none_match is not None and none_match != "*":
                raise Refused("NotImplemented")
            if none_match == "*" and there is not None:
                raise Refused("PreconditionFailed")
            if match is not None and there is None:
                raise Refused("NoSuchKey")
            if match is not None and there is not None and match != there.tag:
                raise Refused("PreconditionFailed")
            new = Object(content, datetime.now(UTC).replace(microsecond=0) + self.ahead)
            self.bucket(bucket)[key] = new
            return new

    def delete(self, bucket: str, key: str) -> None:
        """Remove an object, if there is one."""
        with self.lock:
            self.bucket(bucket).pop(key, None)


class Handler(BaseHTTPRequestHandler):
    """Answers one connection."""

    protocol_version = "HTTP/1.1"
    # Head and body of an answer are two writes; a client that confirms late would wait 40 ms between them.
    disable_nagle_algorithm = True
    server: "Server"

    def handle(self) -> None:
        """Answer requests until the connection ends, by the other side or by the server's going away."""
        self.server.connections.add(self.connection)
        try:
            super().handle()
        except OSError:
            self.close_connection = True
        finally:
            self.server.connections.discard(self.connection)

    def log_message(self, format: str, *words: object) -> None:
        """Say nothing."""

    def do_GET(self) -> None:
        """Answer an object, or a listing of a bucket."""
        self._answer(lambda bucket, key, query: self._get(bucket, key) if key else self._list(bucket, query))

    def do_HEAD(self) -> None:
        """Answer what is to be said of an object."""
        self.do_GET()

    def do_PUT(self) -> None:
        """Write an object, or make a bucket."""
        self._answer(self._put)

    def do_DELETE(self) -> None:
        """Remove an object."""
        self._answer(self._delete)

    def do_POST(self) -> None:
        """Remove several objects."""
        self._answer(self._delete_several)

    def _answer(self, method: Callable[[str, str, Query], Answer]) -> None:
        self.body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        where = urlsplit(self.path)
        bucket, _, key = unquote(where.path).lstrip("/").partition("/")
        try:
            if f"Credential={USER}/" not in self.headers.get("Authorization", ""):
                raise Refused("InvalidAccessKeyId")
            status, headers, content = method(bucket, key, parse_qs(where.query, keep_blank_values=True))
        except Refused as refusal:
            status, words = REFUSALS[str(refusal)]
            headers = {"Content-Type": "application/xml"}
            content = f"<Error><Code>{refusal}</Code><Message>{words}</Message></Error>".encode()
        self.send_response(status)
        for name, value in {**headers, "Content-Length": str(len(content))}.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    def _get(self, bucket: str, key: str) -> Answer:
        found = self.server.buckets.object(bucket, key)
        headers = {"ETag": found.tag, "Last-Modified": format_datetime(found.written, usegmt=True)}
        part = re.fullmatch(r"bytes=(\d*)-(\d*)", self.headers.get("Range", ""))
        if not part:
            return HTTPStatus.OK, headers, found.content
        size = len(found.content)
        first = int(part[1]) if part[1] else max(0, size - int(part[2]))
        last = min(int(part[2]), size - 1) if part[1] and part[2] else size - 1
        headers["Content-Range"] = f"bytes {first}-{last}/{size}"
        return HTTPStatus.PARTIAL_CONTENT, headers, found.content[first : last + 1]

    def _list(self, bucket: str, query: Query) -> Answer:
        """Answer keys that begin with a prefix; with a delimiter, those beyond it as what they share."""
        (prefix,), (delimiter,) = query.get("prefix", [""]), query.get("delimiter", [""])
        entries, shared = list[str](), set[str]()
        for key, found in sorted(self.server.buckets.bucket(bucket).items()):
            rest = key.removeprefix(prefix)
            if not key.startswith(prefix):
                continue
            if delimiter and delimiter in rest:
                shared.add(prefix + rest.partition(delimiter)[0] + delimiter)
                continue
            entries.append(
                f"<Contents><Key>{escape(key)}</Key><LastModified>{found.written:%Y-%m-%dT%H:%M:%S.000Z}</LastModified>"
                f"<ETag>{escape(found.tag)}</ETag><Size>{len(found.content)}</Size></Contents>"
            )
        entries += [f"<CommonPrefixes><Prefix>{escape(one)}</Prefix></CommonPrefixes>" for one in sorted(shared)]
        return HTTPStatus.OK, {}, _document("ListBucketResult", entries)

    def _put(self, bucket: str, key: str, query: Query) -> Answer:
        if not key:
            self.server.buckets.kept.setdefault(bucket, {})
            return HTTPStatus.OK, {}, b""
        if query:
            raise Refused("NotImplemented")
        conditions = self.headers.get("If-Match"), self.headers.get("If-None-Match")
        return HTTPStatus.OK, {"ETag": self.server.buckets.put(bucket, key, self.body, *conditions).tag}, b""

    def _delete(self, bucket: str, key: str, query: Query) -> Answer:
        self.server.buckets.delete(bucket, key)
        return HTTPStatus.NO_CONTENT, {}, b""

    def _delete_several(self, bucket: str, key: str, query: Query) -> Answer:
        if "delete" not in query:
            raise Refused("NotImplemented")
        keys = [one.text or "" for one in ElementTree.fromstring(self.body).iter() if one.tag.endswith("Key")]
        for one in keys:
            self.server.buckets.delete(bucket, one)
        told = [f"<Deleted><Key>{escape(one)}</Key></Deleted>" for one in keys]
        return HTTPStatus.OK, {}, _document("DeleteResult", told)


class Server(ThreadingHTTPServer):
    """A server on a port of this machine; port 0 takes a free one."""

    daemon_threads = True
    #: What is waiting for its turn when many ask at once.
    request_queue_size = 64

    def __init__(self, buckets: Buckets, port: int) -> None:
        super().__init__(("127.0.0.1", port), Handler)
        self.buckets, self.connections = buckets, set[socket.socket]()

    def handle_error(self, request: object, client_address: object) -> None:
        """Say nothing of a client that has gone."""


@contextmanager
def serving(buckets: Buckets, port: int = 0) -> Iterator[str]:
    """Serve buckets and yield the endpoint's address; in the end it is gone, with all connections, not the buckets."""
    server = Server(buckets, port)
    thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()
        for connection in list(server.connections):
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
        thread.join()


def environment(endpoint: str) -> dict[str, str]:
    """Return the environment in which programs use an endpoint."""
    return {
        "AWS_ENDPOINT_URL": endpoint,
        "AWS_ACCESS_KEY_ID": USER,
        "AWS_SECRET_ACCESS_KEY": SECRET,
        # Nobody is asked there who might give out credentials of this machine.
        "AWS_METADATA_ENDPOINT": endpoint,
    }


def _document(name: str, parts: list[str]) -> bytes:
    namespace = "http://s3.amazonaws.com/doc/2006-03-01/"
    return f'<?xml version="1.0" encoding="UTF-8"?><{name} xmlns="{namespace}">{"".join(parts)}</{name}>'.encode()
