'use strict';
// Socket.IO with its WebSocket transport: one emit() to everybody.

const http = require('node:http');
const { Server } = require('socket.io');
const { feed, options } = require('./feed.cjs');

const server = http.createServer();
const io = new Server(server, { transports: ['websocket'], serveClient: false });
server.listen({ host: '127.0.0.1', port: 0, backlog: 4096 }, () => {
  console.log(`PORT ${server.address().port}`);
  feed(options(), (frame) => io.emit('f', frame));
});
