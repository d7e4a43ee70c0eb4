// Ports of loopback for programs that take a number, not a socket.
import { createSocket } from 'node:dgram';
import { once } from 'node:events';
import { connect, createServer } from 'node:net';

/**
 * One that was only bound and closed may be anybody's a moment later. This one had a connection that this side closed first: for a minute
 * (TIME_WAIT) the system gives it to nobody who asks for any port, nor to an outgoing connection, but lets who names it listen (SO_REUSEADDR).
 */
export async function free_tcp_port() {
  const listener = createServer((socket) => socket.end()).listen(0, '127.0.0.1');
  await once(listener, 'listening');
  const { port } = listener.address(),
    guest = connect({ port, host: '127.0.0.1' });
  guest.resume();
  await once(guest, 'close');
  await new Promise((done) => listener.close(done));
  return port;
}

export async function free_udp_port() {
  const socket = createSocket('udp4');
  await new Promise((done) => socket.bind(0, '127.0.0.1', done));
  const { port } = socket.address();
  await new Promise((done) => socket.close(done));
  return port;
}
