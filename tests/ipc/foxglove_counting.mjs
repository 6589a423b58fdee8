// Foxglove's own client and decoders, in node and in browsers: subscribes to topics, and counts messages that can't be
// decoded, or whose stamp is not that of the frame or not newer than the one before.
import { FoxgloveClient } from "@foxglove/ws-protocol";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";

export function counting(socket, count, topics, finish) {
  const client = new FoxgloveClient({ ws: socket });
  const readers = new Map();
  const last = new Map();
  let total = 0;
  let wrong = 0;
  const done = () => finish({ total, wrong, topics: last.size });

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
    if (++total === count) done();
  });
  client.on("close", done);
}
