// What a script answers at best: Node's own server, a process of its own so that its CPU time can be read. GET gives a
// constant body; POST parses each line of its body and stores nothing.
import { createServer } from 'node:http';

const body = JSON.stringify({ version: '0.2.0', git: '0123456789ab', schema: 12, api: 'v1', build: 'release' });
const server = createServer((request, response) => {
  const answer = (text) =>
    response
      .writeHead(200, { 'content-type': 'application/json', 'content-length': Buffer.byteLength(text) })
      .end(text);
  if (request.method !== 'POST') return answer(body);
  const pieces = [];
  request.on('data', (piece) => pieces.push(piece));
  request.on('end', () => {
    const rows = Buffer.concat(pieces)
      .toString()
      .split('\n')
      .filter(Boolean)
      .map((line) => JSON.parse(line));
    answer(JSON.stringify({ accepted: rows.length }));
  });
});
server.listen(0, '127.0.0.1', () => console.log(server.address().port));
