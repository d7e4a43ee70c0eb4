/// What the server finds wrong with the plan as it is drawn, how long it flies, and how its height goes.
import { setting, type Check, type Plan } from '../../api/plans';
import type { Geodetic } from '../../map/enu';
import { clock, fixed, grouped } from '../../ui/format';
import { Chip } from '../../ui/marks';
import { Axes, Drawing, line, scale, ticks, room } from '../chart';
import type { Picked } from './draft';
import { profile } from './profile';

export function CheckPanel({
  check,
  old,
  plan,
  waits,
}: {
  check: Check | null;
  old: boolean;
  plan: Plan;
  waits: string;
}) {
  return (
    <section class={`sec-p${old ? ' judging' : ''}`} data-testid="check">
      <div class="hd">
        <h2>Check</h2>
        {check && old && (
          <span class="meta" role="status">
            {waits}
          </span>
        )}
        {check && !old && (
          <Chip
            shape={check.flyable ? 'ok' : 'bad'}
            tone={check.flyable ? 'ok' : 'bad'}
            word={check.flyable ? 'CAN BE FLOWN' : 'CANNOT BE FLOWN'}
          />
        )}
      </div>
      {!check && (
        <p class="why">{plan.outline.length < 3 && !plan.waypoints.length ? 'Nothing is drawn yet.' : waits}</p>
      )}
      {check && (
        <dl class="kv">
          <div>
            <dt>Flight</dt>
            <dd>
              <span data-testid="flight-time">{clock(check.duration_s, true)}</span>
              <span class="u">
                {' '}
                {clock(check.duration_low_s, true)} to {clock(check.duration_high_s, true)}
              </span>
            </dd>
          </div>
          <div>
            <dt>Route</dt>
            <dd>{grouped(check.length_m)} m</dd>
          </div>
          <div>
            <dt>Measuring points</dt>
            <dd>{grouped(check.n_measure)}</dd>
          </div>
          <div>
            <dt>Error expected</dt>
            <dd>{check.rms_m === null ? '–' : `${fixed(check.rms_m * 100, 1)} cm`}</dd>
          </div>
          <div>
            <dt>Worst anchor</dt>
            <dd>{check.worst_m === null ? '–' : `${fixed(check.worst_m * 100, 1)} cm`}</dd>
          </div>
        </dl>
      )}
      {check && (
        <ul class="issues">
          {check.issues.map((i, k) => (
            <li key={k}>
              <Chip
                shape={i.severity === 'error' ? 'bad' : 'caution'}
                tone={i.severity === 'error' ? 'bad' : 'caution'}
                word={i.severity.toUpperCase()}
              />{' '}
              {i.text}
            </li>
          ))}
        </ul>
      )}
    </section>
  );
}

/// Height over time, with the band it must stay in and the roof. A press near a waypoint picks it.
export function Profile({
  plan,
  origin,
  picked,
  pick,
}: {
  plan: Plan;
  origin: Geodetic;
  picked: Picked | null;
  pick: (p: Picked) => void;
}) {
  const moments = profile(plan, origin),
    end = moments[moments.length - 1]?.t_s ?? 0;
  if (plan.waypoints.length < 2) return null;
  const low = setting(plan, 'min_height_m'),
    high = setting(plan, 'max_height_m'),
    top = Math.max(plan.building_height_m, ...moments.map((m) => m.height_m)) * 1.15,
    out = moments.filter((m) => m.height_m < low || m.height_m > high),
    heights = moments.map((m) => m.height_m);
  return (
    <section class="sec-p" data-testid="profile">
      <div class="hd">
        <h2>Height over time</h2>
        <span class="meta">{clock(end, true)} flying and dwelling only</span>
      </div>
      <Drawing
        cls="profile"
        label={
          `Height over time: ${plan.waypoints.length} waypoints in ${clock(end, true)}, between ` +
          `${fixed(Math.min(...heights), 1)} and ${fixed(Math.max(...heights), 1)} m above the ` +
          `ground${out.length ? `, ${new Set(out.map((m) => m.waypoint)).size} of them outside of ${fixed(low, 1)} to ${fixed(high, 1)} m` : ''}`
        }
        draw={(w, h) => {
          const f = { w, h, left: room(44), right: 10, top: 8, bottom: room(24) },
            x = scale([0, end || 1], [f.left, w - f.right]),
            y = scale([0, top], [h - f.bottom, f.top]),
            edge = (v: number, cls: string, words: string, above: boolean) =>
              v <= top && (
                <g>
                  <path class={`s ${cls}`} d={`M${f.left} ${y(v)}H${w - f.right}`} />
                  <text class="ticktext halo" x={w - f.right} y={y(v) + (above ? -4 : 13)} text-anchor="end">
                    {words}
                  </text>
                </g>
              );
          const at = picked?.shape === 'waypoints' ? moments.find((m) => m.waypoint === picked.index) : undefined;
          return (
            <>
              <Axes
                f={f}
                x={x}
                y={y}
                xs={ticks(0, end, 4)}
                ys={ticks(0, top, 3)}
                xw={(v) => clock(v, true)}
                yw={(v) => `${fixed(v, 0)} m`}
              />
              {edge(plan.building_height_m, 'roof', 'roof', true)}
              {edge(low, 'edge', 'lowest', false)}
              {edge(high, 'edge', 'highest', true)}
              <path class="s main" d={line(moments.map((m) => [x(m.t_s), y(m.height_m)]))} />
              {out.map((m, i) => (
                <path key={i} class="outband" d={`M${x(m.t_s) - 5} ${y(m.height_m) - 5}l10 10m0 -10l-10 10`} />
              ))}
              {at && <circle class="dot" cx={x(at.t_s)} cy={y(at.height_m)} r="5" />}
              <rect
                class="hitarea"
                x={f.left}
                y={0}
                width={Math.max(0, w - f.left - f.right)}
                height={h}
                onClick={(e) => {
                  const t = ((e.offsetX - f.left) / (w - f.left - f.right)) * end,
                    near = moments.reduce((a, b) => (Math.abs(b.t_s - t) < Math.abs(a.t_s - t) ? b : a));
                  pick({ shape: 'waypoints', index: near.waypoint });
                }}
              />
            </>
          );
        }}
      />
    </section>
  );
}
