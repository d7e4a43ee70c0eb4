/// The devices of this server, read every two seconds, with what each stands for.
import { useEffect, useRef, useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import { devices as fetch_devices, type Device } from '../../api/devices';
import { lately, LATELY_MS, standing, type Lately, type Look, type Standing } from './standing';

export interface Row {
  readonly d: Device;
  readonly s: Standing;
  readonly recent: Lately;
}

/// Keeps the last looks at every device: what it dropped lately says more than what it dropped since it was plugged in.
export function useDevices(): {
  readonly all: readonly Device[] | null;
  readonly rows: readonly Row[];
  readonly problem: string;
  readonly load: () => void;
} {
  const [all, set_all] = useState<readonly Device[] | null>(null),
    [problem, set_problem] = useState(''),
    looks = useRef(new Map<string, Look[]>());
  const load = (): void => {
    fetch_devices().then(
      (list) => {
        const at_ms = performance.now();
        for (const d of list)
          if (d.id)
            looks.current.set(d.id, [
              ...(looks.current.get(d.id) ?? []).filter((l) => at_ms - l.at_ms <= LATELY_MS),
              { at_ms, counters: d.counters, dropped: d.dropped },
            ]);
        set_all(list);
        set_problem('');
      },
      (e: unknown) => set_problem(error_text(e)),
    );
  };
  useEffect(() => {
    load();
    const timer = setInterval(load, 2000);
    return () => clearInterval(timer);
  }, []);
  const rows = (all ?? [])
    .filter((d) => d.id !== null)
    .map((d) => {
      const recent = lately(looks.current.get(d.id!) ?? []);
      const same_id = all!.some(
        (o) =>
          o.id !== null &&
          o.id !== d.id &&
          o.network_id !== null &&
          o.network_id === d.network_id &&
          o.state !== 'lost' &&
          o.state !== 'off' &&
          o.state !== 'found',
      );
      return { d, recent, s: standing(d, recent, same_id) };
    });
  return { all, rows, problem, load };
}
