/// Where live data comes from. The views know this interface only, so that a recording can feed them as well as a socket.
import type { TopicName } from './stream';

export type LinkState = 'connecting' | 'live' | 'late' | 'lost';

export interface LiveSink {
  /// A snapshot replaces all that is known of the topic.
  snap(topic: TopicName, data: unknown, t_us: number): void;
  data(topic: TopicName, data: unknown, t_us: number): void;
  /// Messages of a lossy topic are gone and the sender said so.
  gap(topic: TopicName, dropped: number): void;
  /// Another life of the server: everything known is replaced by the snapshots that follow.
  restarted(): void;
  /// After an interruption all topics are up to date again: by replay of so many messages of each, or by snapshots.
  resumed(recovered: ReadonlyMap<TopicName, number>, resynchronised: boolean): void;
  link(state: LinkState): void;
  /// Name and version of the server, each time it greets.
  server(name: string): void;
  /// A conversation ended before it began, or the server refused it: the session may have run out.
  refused(): void;
}

export interface LiveSource {
  start(sink: LiveSink): void;
  stop(): void;
  retryNow(): void;
  pause(): void;
  /// Whether the other end speaks of a topic at all.
  offers(topic: TopicName): boolean;
  /// Microseconds since 1970 by the source's clock.
  now_us(): number;
  /// Milliseconds of silence, and until the next attempt (null while connected).
  silence_ms(): number;
  /// Milliseconds since the server made what arrived last: more than the silence where the link cannot keep up.
  data_age_ms(): number;
  /// Whether the server leaves messages out because this link is too slow for them.
  slow(): boolean;
  retry_in_ms(): number | null;
}
