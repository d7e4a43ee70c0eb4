/// Recording a labelled place: which anchors are in range, the ranges of one as they come, and their import into the campaign.
import { useEffect, useRef, useState } from 'preact/hooks';
import { ApiError, idempotency_key, error_text } from '../../api/client';
import { import_lines, make_campaign, newest_us, ranges_after, settings_of, type Setting } from '../../api/campaign';
import type { Source } from '../../api/measurements';
import { num } from '../../live/messages';
import { current_mission, current_scene, devices, tick } from '../../state/store';
import { useDraft } from '../../ui/use_draft';
import { lines_of, missing, NEW_PLACE, setting_of, truth_query, typed_number, type Place } from './take';

const LOOK_MS = 400,
  SILENT_MS = 10_000;
export interface Take {
  readonly values: readonly number[];
  readonly silent: boolean;
}

export function useTake(campaigns: readonly Source[], taken: (campaign: string) => void) {
  tick.value;
  const mission = current_mission.value,
    scene = current_scene();
  // Without a position of the tag ranges are worked off late; that an anchor talks is known at once.
  const talking = devices.value.filter((d) => d.kind === 'anchor' && d.state === 'live').map((d) => d.network_id),
    heard = [...new Set([...(scene?.ranges.keys() ?? []), ...(scene?.anchors.keys() ?? []), ...talking])].sort();
  const [place, change] = useDraft<Place>('campaign', NEW_PLACE),
    [take, set_take] = useState<Take | null>(null),
    [done, set_done] = useState(''),
    [problem, set_problem] = useState(''),
    [settings, set_settings] = useState<readonly Setting[]>([]);
  const running = useRef<{ stopped: boolean } | null>(null),
    wanted = typed_number(place.wanted) ?? 0,
    lacks = missing(place),
    anchors = place.anchor && !heard.includes(place.anchor) ? [place.anchor, ...heard] : heard;
  const look = (): void => {
    const name = place.campaign.trim();
    if (campaigns.some((c) => c.name === name)) settings_of(name).then(set_settings, () => undefined);
    else set_settings([]);
  };
  useEffect(look, [place.campaign, campaigns]);
  useEffect(
    () => () => {
      if (running.current) running.current.stopped = true;
    },
    [],
  );

  const record = async (): Promise<void> => {
    const me = { stopped: false };
    running.current = me;
    set_problem('');
    set_done('');
    set_take({ values: [], silent: false });
    try {
      const after = await newest_us(mission!.mission, place.anchor);
      for (
        let heard_ms = performance.now(), n = 0;
        n < wanted && !me.stopped;
        await new Promise((next) => setTimeout(next, LOOK_MS))
      ) {
        const rows = await ranges_after(mission!.mission, place.anchor, after, wanted, false),
          values = rows.map((r) => num(r.distance_m) ?? 0);
        if (values.length > n) heard_ms = performance.now();
        n = values.length;
        if (!me.stopped) set_take({ values, silent: performance.now() - heard_ms > SILENT_MS });
        if (n >= wanted) break;
      }
      if (!me.stopped) {
        const rows = await ranges_after(mission!.mission, place.anchor, after, wanted, true),
          name = place.campaign.trim();
        if (!campaigns.some((c) => c.name === name))
          await make_campaign(name, idempotency_key()).catch((e: unknown) => {
            if (!(e instanceof ApiError && e.problem.status === 409)) throw e;
          });
        const kept = await import_lines(name, truth_query(place), lines_of(rows), idempotency_key());
        const dropped = kept.dropped.map((d) => `${d.count} ${d.reason}`).join(', ');
        set_done(
          `${kept.accepted} of ${rows.length} kept as ${setting_of(place)}${dropped && `; rejected: ${dropped}`}`,
        );
        taken(name);
        look();
      }
    } catch (e) {
      set_problem(error_text(e));
    }
    running.current = null;
    set_take(null);
  };
  const stop = (): void => {
    if (running.current) running.current.stopped = true;
  };
  return { mission, place, change, anchors, wanted, lacks, take, done, problem, settings, record, stop };
}
