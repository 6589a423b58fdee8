// node bundle.js URL SUBPROTOCOL COUNT TOPIC...
import WebSocket from "ws";
import { counting } from "./foxglove_counting.mjs";

const [url, subprotocol, count, ...topics] = process.argv.slice(2);
counting(new WebSocket(url, [subprotocol]), Number(count), topics, (counted) => {
  console.log(JSON.stringify(counted));
  process.exit(0);
});
