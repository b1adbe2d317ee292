"""The one decoder of messages: bytes of a topic in, and a message, or one kind of error, out.

Every subscription of the suite receives bytes (`pam_ros.subscriptions`) and decodes them here, or
by a reader for one type that raises the same error.
"""

from __future__ import annotations

from typing import Any

from rclpy.serialization import deserialize_message, serialize_message

from pam_ros.errors import MalformedMessageError
from pam_ros.message_layout import check_layout


def decode(data: bytes, kind: Any) -> Any:
    """A message from its bytes.

    Raises
    ------
    MalformedMessageError
        If the bytes are no message of this type.
    """
    check_layout(data, kind)
    try:
        return deserialize_message(data, kind)
    except Exception as error:  # the kind depends on the middleware
        raise MalformedMessageError(
            f"the middleware cannot read it ({type(error).__name__})"
        ) from None


def encode(message: Any) -> bytes:
    """The bytes of a message, as they are sent."""
    return bytes(serialize_message(message))


def checked(data: bytes, kind: Any) -> bytes:
    """The bytes themselves, if they are a message of this type.

    Raises
    ------
    MalformedMessageError
        If the bytes are no message of this type.
    """
    check_layout(data, kind)
    return data
