// What npm's readers of MCAP and protobuf find in our logs, as JSON lines on standard output.
//
//   node read_log.mjs count FILE...    by the stream reader: messages of each topic, one line a file
//   node read_log.mjs stream FILE      by the stream reader: each record, with decoded messages
//   node read_log.mjs index FILE       by the indexed reader: what the summary says and leads to
//   node read_log.mjs fields FILE      of each schema: the fields of its messages, with their numbers
//   node read_log.mjs ranges FILE < Q  by the indexed reader: heads of the messages asked for by each
//                                      line of Q, {"begin": "1", "end": "5", "topics": ["a"]}: from
//                                      begin on, before end; without topics: of all
//
// 64-bit integers are strings. CRCs are checked. What a reader complains of is "error" in the line of
// a file, and otherwise ends this with 1.

import { open } from "node:fs/promises";
import { createInterface } from "node:readline";

import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { loadDecompressHandlers } from "@mcap/support";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";

const PIECE_BYTES = 4 << 20;

function print(value) {
  const text = JSON.stringify(value, (_, part) => {
    if (typeof part === "bigint") {
      return part.toString();
    }
    return part instanceof Map ? Object.fromEntries(part) : part;
  });
  process.stdout.write(text + "\n");
}

/** Gives each record of a file in its order; returns whether it has an end, and what was left over. */
async function* streamed(name) {
  const reader = new McapStreamReader({
    includeChunks: true,
    validateCrcs: true,
    decompressHandlers: await loadDecompressHandlers(),
  });
  const file = await open(name);
  try {
    for (;;) {
      const { bytesRead, buffer } = await file.read(Buffer.alloc(PIECE_BYTES), 0, PIECE_BYTES);
      if (bytesRead === 0) {
        break;
      }
      reader.append(buffer.subarray(0, bytesRead));
      for (let record; (record = reader.nextRecord()); ) {
        yield record;
      }
    }
  } finally {
    await file.close();
  }
  return { type: "end", is_whole: reader.done(), bytes_left: reader.bytesRemaining() };
}

/** Decodes messages by the schemas that the file has, and by nothing else. */
class Decoder {
  #types = new Map();
  #channels = new Map();

  take(record) {
    if (record.type === "Schema") {
      const files = descriptor.FileDescriptorSet.decode(record.data);
      this.#types.set(record.id, protobuf.Root.fromDescriptor(files).lookupType(record.name));
    } else if (record.type === "Channel") {
      this.#channels.set(record.id, record);
    }
  }

  channel(message) {
    return this.#channels.get(message.channelId);
  }

  decode(message) {
    const type = this.#types.get(this.channel(message).schemaId);
    return type.toObject(type.decode(message.data), {
      longs: String,
      enums: String,
      bytes: String,
      defaults: true,
      arrays: true,
      objects: true,
      json: true,
    });
  }
}

async function count(names) {
  for (const name of names) {
    const line = { file: name, topics: {}, chunks: 0, error: null };
    const topics = new Map();
    try {
      for await (const record of streamed(name)) {
        if (record.type === "Channel") {
          topics.set(record.id, record.topic);
        } else if (record.type === "Chunk") {
          ++line.chunks;
        } else if (record.type === "Message") {
          const topic = topics.get(record.channelId);
          line.topics[topic] = (line.topics[topic] ?? 0) + 1;
        }
      }
    } catch (error) {
      line.error = String(error);
    }
    print(line);
  }
}

async function stream(name) {
  const decoder = new Decoder();
  const records = streamed(name);
  for (;;) {
    const { value: record, done } = await records.next();
    if (done) {
      print(record);
      return;
    }
    decoder.take(record);
    if (record.type === "Message") {
      const { type, sequence, logTime, publishTime } = record;
      const value = decoder.decode(record);
      print({ type, topic: decoder.channel(record).topic, sequence, logTime, publishTime, value });
    } else if (record.type === "Chunk") {
      print({ ...record, records: record.records.byteLength });
    } else if (record.type === "Schema") {
      print({ ...record, data: record.data.byteLength });
    } else if (record.type === "Attachment") {
      print({ ...record, data: new TextDecoder().decode(record.data) });
    } else if (record.type !== "MessageIndex") {
      print(record);
    }
  }
}

/** The indexed reader of an open file. */
async function indexed(file) {
  const { size } = await file.stat();
  return await McapIndexedReader.Initialize({
    readable: {
      size: async () => BigInt(size),
      read: async (offset, length) => {
        const buffer = new Uint8Array(Number(length));
        const { bytesRead } = await file.read(buffer, 0, buffer.length, Number(offset));
        if (bytesRead !== buffer.length) {
          throw new Error(`expected ${length} bytes at ${offset}, found ${bytesRead}`);
        }
        return buffer;
      },
    },
    decompressHandlers: await loadDecompressHandlers(),
  });
}

async function index(file) {
  const reader = await indexed(file);
  print({ type: "Header", ...reader.header });
  print({ ...reader.statistics });
  for (const chunk of reader.chunkIndexes) {
    print(chunk);
  }
  for (const channel of reader.channelsById.values()) {
    print({ ...channel, schema: reader.schemasById.get(channel.schemaId).name });
  }
  for await (const attachment of reader.readAttachments()) {
    print({ ...attachment, data: new TextDecoder().decode(attachment.data) });
  }
  for await (const metadata of reader.readMetadata()) {
    print(metadata);
  }
}

/** The fields of a type and of all that is in it: by type, by name, the number and the type. */
function fieldsOf(type, found = {}) {
  const name = type.fullName.replace(/^[.]/, "");
  if (name in found) {
    return found;
  }
  found[name] = {};
  for (const field of type.fieldsArray) {
    field.resolve();
    const resolved = field.resolvedType?.fullName.replace(/^[.]/, "") ?? field.type;
    found[name][field.name] = [field.id, (field.repeated ? "repeated " : "") + resolved];
    if (field.resolvedType instanceof protobuf.Type) {
      fieldsOf(field.resolvedType, found);
    }
  }
  return found;
}

async function fields(file) {
  const reader = await indexed(file);
  for (const { name, data, encoding } of reader.schemasById.values()) {
    const root = protobuf.Root.fromDescriptor(descriptor.FileDescriptorSet.decode(data));
    print({ type: "fields", name, encoding, fields: fieldsOf(root.lookupType(name)) });
  }
}

async function ranges(file) {
  const reader = await indexed(file);
  for await (const line of createInterface({ input: process.stdin })) {
    const { begin, end, topics } = JSON.parse(line);
    const found = [];
    // The reader's own end is included.
    const query = { startTime: BigInt(begin), endTime: BigInt(end) - 1n, topics };
    for await (const message of reader.readMessages({ ...query, validateCrcs: true })) {
      const { topic } = reader.channelsById.get(message.channelId);
      found.push([topic, message.sequence, message.logTime]);
    }
    print(found);
  }
}

const [what, ...names] = process.argv.slice(2);
if (what === "count" && names.length > 0) {
  await count(names);
} else if (what === "stream" && names.length === 1) {
  await stream(names[0]);
} else if (["index", "fields", "ranges"].includes(what) && names.length === 1) {
  const file = await open(names[0]);
  await { index, fields, ranges }[what](file);
  await file.close();
} else {
  process.stderr.write("usage: read_log.mjs count FILE... | stream FILE | index FILE | fields FILE | ranges FILE\n");
  process.exitCode = 2;
}
