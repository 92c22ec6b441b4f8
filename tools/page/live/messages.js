// Messages of protobuf by the schemas that the server sends; nothing of this is known when the page is made.
import { createFileRegistry, fromBinary } from "@bufbuild/protobuf";
import { base64Decode } from "@bufbuild/protobuf/wire";
import { FileDescriptorSetSchema } from "@bufbuild/protobuf/wkt";

export class MessageTypes {
  #registries = new Map();  // By schema: many topics have the same.

  // Of a channel; throws if its schema cannot be read.
  of({ schema, schemaName }) {
    let registry = this.#registries.get(schema);
    if (!registry) {
      registry = createFileRegistry(fromBinary(FileDescriptorSetSchema, base64Decode(schema)));
      this.#registries.set(schema, registry);
    }
    const type = registry.getMessage(schemaName);
    if (!type) {
      throw new Error(`the schema has no type ${schemaName}`);
    }
    return type;
  }

  clear() {
    this.#registries.clear();
  }
}

export function decode(type, payload) {
  return fromBinary(type, payload, { readUnknownFields: false });
}

// A field of a message type by its name in the schema.
export function fieldOf(type, name) {
  return type.fields.find((field) => field.name === name);
}

// What a message has in a field; undefined where a message within is not there.
export function valueOf(message, field) {
  return field.oneof
    ? (message[field.oneof.localName].case === field.localName ? message[field.oneof.localName].value : undefined)
    : message[field.localName];
}

// The type of what a list has, or of the field itself.
export function kindOf(field) {
  return field.fieldKind === "list" ? field.listKind : field.fieldKind;
}

export function enumName(field, number) {
  return field.enum.value[number]?.name ?? String(number);
}

// A value that is no message, as a number to draw; null if it is none.
export function numberOf(value) {
  return typeof value === "number" ? (Number.isFinite(value) ? value : null)
    : typeof value === "bigint" ? Number(value)
    : typeof value === "boolean" ? Number(value) : null;
}

// A way through a message: names of fields, and places in lists.
export function numberAt(message, type, path) {
  let value = message;
  let within = type;
  for (const step of path) {
    if (value === undefined || value === null) {
      return null;
    }
    if (typeof step === "number") {
      value = value[step];
    } else {
      const field = within && fieldOf(within, step);
      if (!field) {
        return null;
      }
      value = valueOf(value, field);
      within = kindOf(field) === "message" ? field.message : null;
    }
  }
  return numberOf(value);
}

export const nameOfPath = (path) => path.reduce((name, step) =>
  typeof step === "number" ? `${name}[${step}]` : name ? `${name}.${step}` : step, "");
