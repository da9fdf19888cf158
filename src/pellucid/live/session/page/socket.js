// The page's connection to the session. It comes back by itself after a break.
"use strict";
const session = {
  token: new URLSearchParams(location.search).get("token") || "",
  socket: null,
  offset: null, // host's clock less this page's [s]
  roundTrip: Infinity,
  onText: () => {},
  onSamples: () => {},
  onOpen: () => {},
  onClose: () => {},
};

// A number as text with a minus sign; one that rounds to zero has no sign.
const fixed = (value, digits) => (Math.abs(value) < 0.5 * 10 ** -digits ? 0 : value).toFixed(digits).replace("-", "−");

session.connect = function (role) {
  const socket = new WebSocket(`ws://${location.host}/socket/${role}?token=${encodeURIComponent(session.token)}`);
  socket.binaryType = "arraybuffer";
  session.socket = socket;
  socket.onopen = () => { session.onOpen(); session.ping(); };
  socket.onclose = () => { session.onClose(); setTimeout(() => session.connect(role), 500); };
  socket.onmessage = (event) => {
    if (typeof event.data !== "string") { session.onSamples(event.data); return; }
    const told = JSON.parse(event.data);
    if (told.type === "pong") session.takePong(told); else session.onText(told);
  };
};

session.send = function (message) {
  if (session.socket && session.socket.readyState === WebSocket.OPEN) session.socket.send(JSON.stringify(message));
};

session.act = function (action, value) { session.send({ type: "act", action: action, value: value }); };

session.ping = function () { session.send({ type: "ping", page: performance.now() }); };

// The shortest round trip bounds the offset best.
session.takePong = function (told) {
  const now = performance.now(), trip = (now - told.page) / 1e3;
  if (trip <= session.roundTrip) {
    session.roundTrip = trip;
    session.offset = told.host - (now + told.page) / 2e3;
  }
};
setInterval(() => { session.roundTrip *= 1.05; session.ping(); }, 2000);
