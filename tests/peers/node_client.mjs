// One case of what node-mavlink can do with a vehicle: `node node_client.mjs CASE PORT HOW`, where HOW is "call" (the
// vehicle listens at the port) or "listen" (it sends to the port). Ends with 0 where the case passes.
import { createSocket } from "node:dgram";
import { PassThrough } from "node:stream";
import {
  ardupilotmega,
  common,
  MavLinkPacketParser,
  MavLinkPacketSplitter,
  MavLinkProtocolV2,
  minimal,
  standard,
} from "node-mavlink";

const [name, port, how] = process.argv.slice(2);
const KINDS = { ...minimal.REGISTRY, ...standard?.REGISTRY, ...common.REGISTRY, ...ardupilotmega.REGISTRY };
const ANSWER_MS = 8000;
const socket = createSocket("udp4");
const stream = new PassThrough();
const splitter = stream.pipe(new MavLinkPacketSplitter());
const reader = splitter.pipe(new MavLinkPacketParser());
const protocol = new MavLinkProtocolV2(255, 190);
const heard = [];
let remote = { address: "127.0.0.1", port: Number(port) };
let known = how === "call";
let sequence = 0;
let wake = () => {};

socket.on("message", (data, from) => {
  remote = from;
  known = true;
  stream.write(data);
});
reader.on("data", (packet) => {
  const kind = KINDS[packet.header.msgid];
  const data = kind && packet.protocol.data(packet.payload, kind);
  heard.push({ packet, kind, data });
  wake();
});

function send(message) {
  if (!known) return;
  const frame = protocol.serialize(message, sequence++ % 256);
  socket.send(frame, remote.port, remote.address);
}

function make(kind, fields) {
  return Object.assign(new kind(), { targetSystem: 1, targetComponent: 1, ...fields });
}

async function next(...kinds) {
  const until = Date.now() + ANSWER_MS;
  for (;;) {
    while (heard.length) {
      const { kind, data } = heard.shift();
      if (kinds.includes(kind)) return data;
    }
    if (Date.now() > until) throw new Error(`no ${kinds.map((kind) => kind.MSG_NAME).join(" or ")}`);
    await Promise.race([
      new Promise((done) => {
        wake = done;
      }),
      new Promise((done) => setTimeout(done, 200)),
    ]);
  }
}

function check(so, words) {
  if (!so) throw new Error(words);
}

async function upload(kind, items) {
  send(make(common.MissionCount, { count: items.length, missionType: kind }));
  for (;;) {
    const asked = await next(common.MissionRequestInt, common.MissionRequest, common.MissionAck);
    if (asked instanceof common.MissionAck) {
      check(asked.type === common.MavMissionResult.ACCEPTED, `refused: ${asked.type}`);
      return;
    }
    send(make(common.MissionItemInt, { seq: asked.seq, missionType: kind, autocontinue: 1, ...items[asked.seq] }));
  }
}

async function download(kind) {
  send(make(common.MissionRequestList, { missionType: kind }));
  const { count } = await next(common.MissionCount);
  const items = [];
  for (let seq = 0; seq < count; seq++) {
    send(make(common.MissionRequestInt, { seq, missionType: kind }));
    items.push(await next(common.MissionItemInt));
  }
  send(make(common.MissionAck, { missionType: kind }));
  return items;
}

const PLACE = { x: 473977420, y: 85455940, z: 20, frame: common.MavFrame.GLOBAL_RELATIVE_ALT_INT };
const MISSION = [
  { ...PLACE, command: 16 },
  { ...PLACE, command: 22 },
  { ...PLACE, command: 16, x: PLACE.x + 10000 },
  { ...PLACE, command: 16, x: PLACE.x + 20000 },
];
const RALLY = [5100, 5100].map((command) => ({ ...PLACE, command, frame: common.MavFrame.GLOBAL_RELATIVE_ALT }));
const FENCE = [5004, 5004].map((command) => ({ ...PLACE, command, param1: 40, z: 0 }));

function upAndDown(kind, items) {
  return async () => {
    await upload(kind, items);
    const back = await download(kind);
    check(back.length === items.length, `${back.length} of ${items.length} items came back`);
    check(back.at(-1).command === items.at(-1).command, "another command came back");
  };
}

async function order(command, ...parameters) {
  const named = Object.fromEntries(parameters.map((value, number) => [`_param${number + 1}`, value]));
  send(make(common.CommandLong, { command, ...named }));
  for (;;) {
    const answer = await next(common.CommandAck);
    if (answer.command === command) return answer.result;
  }
}

const CASES = {
  async "every frame is understood"() {
    send(make(common.RequestDataStream, { reqStreamId: 0, reqMessageRate: 4, startStop: 1 }));
    await new Promise((done) => setTimeout(done, 4000));
    check(heard.length > 10, `only ${heard.length} frames`);
    const strange = heard.filter(({ kind }) => !kind).map(({ packet }) => packet.header.msgid);
    check(strange.length === 0, `unknown messages: ${[...new Set(strange)]}`);
    check(splitter.invalidPackages === 0, `${splitter.invalidPackages} frames with a wrong checksum`);
    const sequences = heard.map(({ packet }) => packet.header.seq);
    const gaps = sequences.slice(1).filter((seq, before) => seq !== (sequences[before] + 1) % 256);
    check(gaps.length === 0, `${gaps.length} gaps of the sequence`);
  },
  async "all parameters"() {
    send(make(common.ParamRequestList, {}));
    const found = new Set();
    for (;;) {
      const value = await next(common.ParamValue);
      found.add(value.paramId);
      if (found.size >= value.paramCount) return;
    }
  },
  async "set a parameter"() {
    send(make(common.ParamRequestList, {}));
    const { paramId, paramValue, paramType } = await next(common.ParamValue);
    send(make(common.ParamSet, { paramId, paramValue, paramType }));
    for (;;) {
      const back = await next(common.ParamValue);
      if (back.paramId === paramId) return;
    }
  },
  mission: upAndDown(common.MavMissionType.MISSION, MISSION),
  fence: upAndDown(common.MavMissionType.FENCE, FENCE),
  "rally points": upAndDown(common.MavMissionType.RALLY, RALLY),
  async "a message on request"() {
    send(make(common.CommandLong, { command: 512, _param1: 148 }));
    check((await next(KINDS[148])).capabilities > 0, "it can do nothing");
  },
  async "a message's interval"() {
    check((await order(511, 30, 100000)) === common.MavResult.ACCEPTED, "refused");
    for (let count = 0; count < 20; count++) await next(common.Attitude);
  },
  async "arm and disarm"() {
    check((await order(400, 1)) === common.MavResult.ACCEPTED, "refused to arm");
    check((await order(400, 0)) === common.MavResult.ACCEPTED, "refused to disarm");
  },
  async "an unknown command is refused"() {
    check((await order(31999)) === common.MavResult.UNSUPPORTED, "not called unsupported");
  },
};

async function main() {
  await new Promise((done) => socket.bind(how === "listen" ? Number(port) : 0, "127.0.0.1", done));
  const heartbeat = new minimal.Heartbeat();
  Object.assign(heartbeat, { type: 6, autopilot: 8, mavlinkVersion: 3 });
  const beat = () => send(heartbeat);
  beat();
  setInterval(beat, 1000);
  await next(minimal.Heartbeat);
  beat();
  await CASES[name]();
}

main().then(
  () => process.exit(0),
  (fault) => {
    process.stderr.write(`${fault.message}\n`);
    process.exit(1);
  },
);
