"""The library of object stores: how a store is opened, and what goes wrong in words."""

import errno
import os
import re
from collections.abc import AsyncGenerator, Iterator
from contextlib import AbstractContextManager, contextmanager
from datetime import timedelta
from functools import lru_cache
from typing import Any

from obstore.exceptions import BaseError
from obstore.store import S3Store
from zarr.storage import ObjectStore

from chatter_core.errors import InvalidInput
from pipeline.errors import StoreUnavailable
from pipeline.places.address import bucket_and_prefix

#: Seconds to wait for a connection.
CONNECTING = timedelta(seconds=5)
#: Pauses between two attempts: the first, and the longest.
FIRST_PAUSE, LONGEST_PAUSE = timedelta(seconds=0.1), timedelta(seconds=5)
#: Code and words of an answer that is an error.
_ANSWER = re.compile(r"<Code>(\w+)</Code>.*?<Message>([^<]*)</Message>", re.DOTALL)
#: What is said of credentials that are not let in; the library has an error of its own for objects, none for listings.
_REFUSED = re.compile(r"status code: 40[13]\b")
#: Address of an endpoint.
_URL = re.compile(r"https?://[\w.\[\]:-]+(/\S*)?")
#: Credentials in an address.
_SECRET = re.compile(r"(?<=://)[^/\s@]+@")
#: Where the library looks for its endpoint.
ENDPOINTS = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT")
#: More attempts than fit into any patience: that alone ends them.
ATTEMPTS = 1000


@lru_cache(maxsize=8)
def opened(address: str, patience: float) -> S3Store:
    """Return the store under an address, with credentials and endpoint of the environment; once a process.

    patience: seconds after which nothing is asked again that was not answered. Raises InvalidInput where the endpoint
    that the environment names is no address.
    """
    bucket, prefix = bucket_and_prefix(address)
    waiting = timedelta(seconds=patience)
    # The library would only stumble over an endpoint that is none.
    _endpoint()
    return S3Store(
        bucket,
        prefix=prefix,
        # Whether it is http or https is for the endpoint's own address to say.
        client_options={"allow_http": True, "connect_timeout": min(CONNECTING, waiting), "timeout": waiting},
        retry_config={
            "max_retries": ATTEMPTS,
            "retry_timeout": waiting,
            "backoff": {"init_backoff": FIRST_PAUSE, "max_backoff": LONGEST_PAUSE, "base": 2},
        },
    )


class ClearStore(ObjectStore[S3Store]):
    """The object store as zarr has it; what goes wrong is told as it is of any place."""

    def _clear(self) -> AbstractContextManager[None]:
        return clear_words(f"s3://{self.store.config['bucket']}/{self.store.prefix}")

    async def get(self, key: str, *args: Any, **options: Any) -> Any:
        """Return the content of an object, None where there is none."""
        with self._clear():
            return await super().get(key, *args, **options)

    async def get_partial_values(self, *args: Any, **options: Any) -> Any:
        """Return parts of objects."""
        with self._clear():
            return await super().get_partial_values(*args, **options)

    async def exists(self, key: str) -> bool:
        """Return whether there is an object."""
        with self._clear():
            return await super().exists(key)

    async def set(self, *args: Any, **options: Any) -> None:
        """Write an object."""
        with self._clear():
            await super().set(*args, **options)

    async def set_if_not_exists(self, *args: Any, **options: Any) -> None:
        """Write an object that is not there."""
        with self._clear():
            await super().set_if_not_exists(*args, **options)

    async def delete(self, key: str) -> None:
        """Remove an object."""
        with self._clear():
            await super().delete(key)

    async def delete_dir(self, prefix: str) -> None:
        """Remove all objects whose key begins so."""
        with self._clear():
            await super().delete_dir(prefix)

    def list_dir(self, prefix: str) -> AsyncGenerator[str, None]:
        """Yield the next parts of all keys that begin so."""
        return self._cleared(super().list_dir(prefix))

    async def _cleared(self, keys: AsyncGenerator[str, None]) -> AsyncGenerator[str, None]:
        with self._clear():
            async for key in keys:
                yield key


@contextmanager
def clear_words(address: str) -> Iterator[None]:
    """Tell what the library says of a request as StoreUnavailable, or FileNotFoundError where an object is missing."""
    try:
        yield
    except (BaseError, FileNotFoundError) as error:
        code, said = _answer(error)
        if isinstance(error, FileNotFoundError) and code != "NoSuchBucket":
            raise FileNotFoundError(errno.ENOENT, said, address) from None
        if code == "NoSuchBucket":
            raise StoreUnavailable(errno.ENOENT, f"there is no such bucket at {_endpoint()}", address) from None
        if _REFUSED.search(str(error)):
            why = f"{_endpoint()} refuses the credentials of the environment (AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY)"
        else:
            why = f"{_endpoint()} cannot be used"
        missing = "" if os.environ.get("AWS_ACCESS_KEY_ID") else "; AWS_ACCESS_KEY_ID is not set"
        raise StoreUnavailable(errno.EIO, f"{why}{missing}: {said}", address) from None


def _answer(error: Exception) -> tuple[str, str]:
    """Return the code of an object store's answer, empty where there was none, and what is to be told of it."""
    text = str(error).strip()
    found = _ANSWER.search(text)
    if found:
        return found[1], f"{found[1]}: {found[2]}"
    return "", _SECRET.sub("", text.partition("\n")[0].removeprefix("Generic S3 error: "))


def _endpoint() -> str:
    """Return the endpoint that the environment names, without what may be secret in it.

    Raises InvalidInput where it is no address.
    """
    for name in ENDPOINTS:
        if os.environ.get(name):
            said = _SECRET.sub("", os.environ[name])
            if not _URL.fullmatch(said):
                raise InvalidInput([f"{name}: found {said!r}, allowed: https://HOST or http://HOST:PORT"])
            return f"{said} ({name})"
    return "Amazon S3 (AWS_ENDPOINT_URL is not set)"
