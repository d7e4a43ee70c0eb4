// A link of so many bytes a second and so many milliseconds each way before a server on loopback, with the short queue of a real one: what does not
// fit waits at the sender.
import { connect, createServer } from 'node:net';

const k_queue_ms = 200,
  k_piece = 1400;

/** {port, cut(), mend(), close()}: connections to it share the link; while it is cut nothing arrives, and nobody is told. */
export async function slowLink(port, { bytes_per_s = 125_000, delay_ms = 150 } = {}) {
  const open = new Set();
  let whole = true;
  const door = createServer((near) => {
    const far = connect(port, '127.0.0.1');
    carry(far, near, down);
    carry(near, far, up);
    for (const end of [near, far]) {
      open.add(end);
      end.setNoDelay(true);
      end.on('error', () => undefined);
      end.on('close', () => {
        open.delete(end);
        near.destroy();
        far.destroy();
      });
    }
  });
  const down = { free_ms: 0 },
    up = { free_ms: 0 };
  function carry(from, to, link) {
    const queue = []; // in order, each piece with when it arrives; null: the end
    let timer;
    const pump = () => {
      timer = undefined;
      if (to.destroyed) queue.length = 0; // nobody waits for it: a link that stays cut would keep the process for good
      while (whole && queue.length && queue[0].at_ms <= performance.now()) {
        const { piece } = queue.shift();
        if (!to.writable) continue;
        if (piece) to.write(piece);
        else to.end();
      }
      if (queue.length) timer = setTimeout(pump, whole ? queue[0].at_ms - performance.now() : 50);
    };
    const send = (piece, bytes) => {
      link.free_ms = Math.max(performance.now(), link.free_ms) + (1000 * bytes) / bytes_per_s;
      queue.push({ piece, at_ms: link.free_ms + delay_ms });
      timer ??= setTimeout(pump, delay_ms);
    };
    from.on('data', (chunk) => {
      for (let at = 0; at < chunk.length; at += k_piece) {
        const piece = chunk.subarray(at, at + k_piece);
        send(piece, piece.length);
      }
      const full_ms = link.free_ms - performance.now() - k_queue_ms;
      if (full_ms <= 0) return;
      from.pause();
      setTimeout(() => from.resume(), full_ms);
    });
    from.on('end', () => send(null, 0));
  }
  await new Promise((done) => door.listen(0, '127.0.0.1', done));
  return {
    port: door.address().port,
    cut: () => (whole = false),
    mend: () => (whole = true),
    close: () => {
      for (const end of open) end.destroy();
      return new Promise((done) => door.close(done));
    },
  };
}
