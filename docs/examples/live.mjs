// node live.mjs http://127.0.0.1:8420 TOKEN system: prints what a topic says, one JSON a line. Node 22 or newer; Node 20: node --experimental-websocket. A page does the same: a ticket instead of a header.
const [url, token, topic] = process.argv.slice(2);
const headers = { authorization: `Bearer ${token}` };
const { ticket } = await (await fetch(`${url}/api/v1/ws-tickets`, { method: 'POST', headers })).json();
const socket = new WebSocket(`${url.replace('http', 'ws')}/api/v1/ws?ticket=${ticket}`, 'anchord.v1');
socket.onopen = () => socket.send(JSON.stringify({ op: 'sub', id: 1, topic }));
socket.onmessage = ({ data }) => {
  const message = JSON.parse(data);
  if (message.op === 'snap' || message.op === 'data') console.log(JSON.stringify(message.data));
};
