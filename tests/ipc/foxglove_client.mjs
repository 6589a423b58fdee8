// Foxglove's own client and decoders: subscribes to topics, and counts messages that can't be decoded, or whose stamp
// is not that of the frame or not newer than the one before. node foxglove_client.mjs URL SUBPROTOCOL COUNT TOPIC...
import { createRequire } from "module";

const require = createRequire(import.meta.url);
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const WebSocket = require("ws");

const [url, subprotocol, count, ...topics] = process.argv.slice(2);
const client = new FoxgloveClient({ ws: new WebSocket(url, [subprotocol]) });
const readers = new Map();
const last = new Map();
let total = 0;
let wrong = 0;

client.on("advertise", (channels) => {
  for (const channel of channels.filter((one) => topics.includes(one.topic))) {
    const reader = new MessageReader(parse(channel.schema, { ros2: true }));
    readers.set(client.subscribe(channel.id), { topic: channel.topic, reader });
  }
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const { topic, reader } = readers.get(subscriptionId);
  const { sec, nanosec } = reader.readMessage(data).header.stamp;
  const stamp = BigInt(sec) * 1000000000n + BigInt(nanosec);
  wrong += stamp !== timestamp || (last.has(topic) && stamp <= last.get(topic)) ? 1 : 0;
  last.set(topic, stamp);
  if (++total === Number(count)) finish();
});
client.on("close", finish);

function finish() {
  console.log(JSON.stringify({ total, wrong, topics: last.size }));
  process.exit(0);
}
