'use strict';
// `ws`, as its README broadcasts: a loop over all clients.

const { WebSocketServer } = require('ws');
const { feed, options } = require('./feed.cjs');

const server = new WebSocketServer({ host: '127.0.0.1', port: 0, backlog: 4096, perMessageDeflate: false });
server.on('connection', (socket) => socket.on('error', () => socket.terminate()));
server.on('listening', () => {
  console.log(`PORT ${server.address().port}`);
  feed(options(), (frame) => {
    for (const socket of server.clients) if (socket.readyState === 1) socket.send(frame, { binary: true });
  });
});
