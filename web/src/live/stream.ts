/// Messages in the types of api/asyncapi.yaml: what is sent is what the contract says, and what came is read by its names.
import type { components } from '../api/generated/stream';

type Schemas = components['schemas'];
/// What the server sends, and what it is sent.
export type Received = Schemas['hello' | 'ack' | 'snap' | 'data' | 'gap' | 'hb' | 'err' | 'bye' | 'time'];
export type Sent = Schemas['sub' | 'unsub' | 'seen' | 'timeRequest'];
export type TopicName = Schemas['sub']['topic'];
/// What a subscription asks for.
export type TopicParams = Readonly<NonNullable<Schemas['sub']['params']>>;

type One<T> = T extends readonly (infer E)[] ? E : T;
/// One element of what stands in `data` of a topic.
export type Topic<Name extends TopicName> = One<Schemas[`topic.${Name}`]>;
