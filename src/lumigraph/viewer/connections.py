"""Bounds on connections: their number, the time to the end of a request, and the time without progress."""

from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

MOST = 512
"""Connections; a new one takes the place of the one that has waited longest for a request."""

TO_REQUEST, TO_PROGRESS = 10.0, 20.0
"""Time to the end of a request, and in which a reader must have taken something [s]."""


class Connection(H11Protocol):
    """A connection that ends when its client is too slow."""

    def connection_made(self, transport: Any) -> None:
        """A client has come."""
        super().connection_made(transport)
        self._since, self._unsent = self.loop.time(), (0, 0.0)
        if len(self.connections) > MOST:
            waiting = [
                each
                for each in self.connections
                if isinstance(each, Connection) and each is not self and each.waiting
            ]
            if waiting:
                min(waiting, key=lambda each: each._since).transport.abort()
        self._watch()

    def on_response_complete(self) -> None:
        """Start the time limit of the next request, after an answer."""
        self._since = self.loop.time()
        super().on_response_complete()

    @property
    def waiting(self) -> bool:
        """True if the client has not yet sent a whole request."""
        return self.conn.their_state in (h11.IDLE, h11.SEND_BODY)

    def _watch(self) -> None:
        if self.transport.is_closing():
            return
        now, unsent = self.loop.time(), self.transport.get_write_buffer_size()
        if unsent == 0 or unsent != self._unsent[0]:
            self._unsent = unsent, now
        stuck = unsent > 0 and now - self._unsent[1] > TO_PROGRESS
        if stuck or (self.waiting and unsent == 0 and now - self._since > TO_REQUEST):
            self.transport.abort()
        else:
            self.loop.call_later(1.0, self._watch)
