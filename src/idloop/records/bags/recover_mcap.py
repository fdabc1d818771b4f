"""Messages of an mcap file up to where it was cut off."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from idloop.records.bags.bag_limits import limit_bag_readers
from idloop.records.bags.recovered_channel import RecoveredChannel, RecoveredMessage


def mcap_messages(file: Path) -> Iterator[RecoveredMessage | None]:
    """Yield the messages of every complete chunk in the order of the file, then None where the file was cut.

    Parameters
    ----------
    file : Path
        ``.mcap`` file, whole or not.
    """
    from mcap.records import Channel, Footer, Message, Schema
    from mcap.stream_reader import StreamReader

    limit_bag_readers()
    schemas: dict[int, Schema] = {}
    channels: dict[int, RecoveredChannel] = {}
    whole = False
    with file.open("rb") as stream:
        try:
            for record in StreamReader(stream).records:
                whole = whole or isinstance(record, Footer)
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    schema = schemas[record.schema_id]
                    channels[record.id] = RecoveredChannel(
                        topic=record.topic,
                        message_type=schema.name,
                        definition=schema.data.decode(),
                        type_hash=record.metadata.get("topic_type_hash", ""),
                        serialization=record.message_encoding,
                    )
                elif isinstance(record, Message):
                    yield RecoveredMessage(channels[record.channel_id], record.log_time, record.data)
        except Exception:  # noqa: BLE001 - the cut may fall anywhere, so any parsing error marks the end
            whole = False
    if not whole:
        yield None
