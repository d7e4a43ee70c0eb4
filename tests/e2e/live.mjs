// A WebSocket client that keeps every message and can be asked for the next one that fits.
import WebSocket from 'ws';

export class LiveClient {
  /** `server` of server.mjs; resolves when the socket is open. */
  static async open(server, { headers = {}, token = server.token, path = '/api/v1/ws', protocol = 'anchord.v1' } = {}) {
    const all = { ...headers };
    if (token) all.authorization = `Bearer ${token}`;
    const socket = new WebSocket(server.url.replace('http', 'ws') + path, protocol, {
      headers: all,
      perMessageDeflate: false,
    });
    const client = new LiveClient(socket);
    await new Promise((done, fail) => {
      socket.once('open', done);
      socket.once('error', fail);
      socket.once('unexpected-response', (_, response) =>
        fail(Object.assign(new Error(`upgrade refused: ${response.statusCode}`), { status: response.statusCode })),
      );
    });
    return client;
  }

  constructor(socket) {
    this.socket = socket;
    this.messages = [];
    this.waiters = [];
    this.closed = new Promise((done) => socket.once('close', (code, reason) => done({ code, reason: String(reason) })));
    socket.on('message', (data) => {
      // Several messages may share one frame as an array or as lines of their own.
      const parsed = JSON.parse(String(data));
      for (const message of Array.isArray(parsed) ? parsed : [parsed]) this.messages.push(message);
      for (const waiter of [...this.waiters]) waiter();
    });
    socket.on('error', () => {});
  }

  send(message) {
    this.socket.send(typeof message === 'string' ? message : JSON.stringify(message));
  }

  /** The first message from index `from` on for which `fits` answers truthy. */
  next(what, fits, { from = 0, deadlineMs = 10_000 } = {}) {
    return new Promise((done, fail) => {
      let at = from;
      const look = () => {
        for (; at < this.messages.length; at++) {
          if (fits(this.messages[at])) return finish(done, this.messages[at]);
        }
      };
      const finish = (how, value) => {
        clearTimeout(timer);
        this.waiters = this.waiters.filter((waiter) => waiter !== look);
        how(value);
      };
      const timer = setTimeout(
        () =>
          finish(
            fail,
            new Error(
              `${what}: not within ${deadlineMs} ms; last messages: ${this.messages
                .slice(-5)
                .map((m) => JSON.stringify(m).slice(0, 200))
                .join('\n')}`,
            ),
          ),
        deadlineMs,
      );
      this.waiters.push(look);
      look();
    });
  }

  close() {
    this.socket.close();
    return this.closed;
  }

  terminate() {
    this.socket.terminate();
  }
}
