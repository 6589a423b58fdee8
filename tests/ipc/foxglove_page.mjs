// page.html?url=...&subprotocol=...&count=...&topic=...&topic=...; what was counted is window.counted
import { counting } from "./foxglove_counting.mjs";

const asked = new URLSearchParams(window.location.search);
const socket = new WebSocket(asked.get("url"), [asked.get("subprotocol")]);
counting(socket, Number(asked.get("count")), asked.getAll("topic"), (counted) => (window.counted = counted));
