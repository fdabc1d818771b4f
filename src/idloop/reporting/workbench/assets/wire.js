// One question after the other over a web socket: a request of its own passes through two more processes of the browser,
// which costs as much as the drawing and, where the processor is busy, waits for its turn in each of them.
"use strict";
const Wire = (() => {
  const AGAIN = 400; // milliseconds after which a lost connection is tried again

  return class {
    // address: of the socket; answered: called with what came; lost: called when there will be no answer to what was asked.
    constructor(address, answered, lost) {
      this.address = address;
      this.answered = answered;
      this.lost = lost;
      this.open();
    }

    open() {
      const socket = this.socket = new WebSocket(this.address);
      socket.binaryType = "arraybuffer";
      socket.addEventListener("open", () => this.lost());
      socket.addEventListener("message", (event) => this.answered(event.data));
      socket.addEventListener("close", () => { this.lost(); setTimeout(() => this.open(), AGAIN); });
    }

    // Whether the question was sent.
    ask(question) {
      if (this.socket.readyState !== WebSocket.OPEN) return false;
      this.socket.send(question);
      return true;
    }

    // A connection may be dead without a sign of it.
    renew() { this.socket.close(); }
  };
})();
