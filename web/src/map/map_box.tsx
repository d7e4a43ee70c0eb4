/// The map as a component: loads the engine when first shown, and offers zoom, follow and fit as buttons.
import { useEffect, useRef, useState } from 'preact/hooks';
import { backdrop_version } from '../state/floors';
import { watched_lost, when_back } from '../state/store';
import { Icon } from '../ui/marks';
import { ground } from '../ui/theme';
import { Elevation } from './elevation_box';
import { elevation_on, elevation_shown } from './elevation_shown';
import { length_words, round_length } from './enu';
import type { MapView, Mode } from './engine';
import { LevelChoice } from './level_choice';
import type { Content } from './picture';

/// The map that is on screen, for the keyboard.
export const current_map: { view: MapView | null } = { view: null };

interface Props {
  content: () => Content;
  onSelect: (anchor: string) => void;
  label: string;
  follow: boolean;
  version: unknown;
  zero?: string | undefined; ///< what heights count from where the ground is not known
}

export function MapBox({ content, onSelect, label, follow, version, zero }: Props) {
  const target = useRef<HTMLDivElement>(null),
    overlay = useRef<HTMLCanvasElement>(null),
    top = useRef<HTMLCanvasElement>(null),
    map = useRef<MapView | null>(null);
  const latest = useRef({ content, onSelect });
  latest.current = { content, onSelect };
  const [mode, set_mode] = useState<Mode>('fit'),
    [attempt, set_attempt] = useState(0);
  const [scale, set_scale] = useState({ px_per_m: 0, magnified: 1 });
  const [failed, set_failed] = useState(false),
    [height_px, set_height] = useState(0),
    sided = height_px > 0 && elevation_on(height_px);
  useEffect(() => set_height(target.current!.parentElement!.clientHeight), []);
  useEffect(() => {
    let gone = false,
      stop = (): void => undefined;
    import('./engine')
      .then(({ open_map }) => {
        if (gone || !target.current || !overlay.current || !top.current) return;
        map.current = open_map(target.current, overlay.current, top.current, {
          content: () => latest.current.content(),
          selected: (id) => latest.current.onSelect(id),
          mode_changed: set_mode,
          camera_changed: (px_per_m, magnified) =>
            set_scale((s) => (s.px_per_m === px_per_m && s.magnified === magnified ? s : { px_per_m, magnified })),
        });
        current_map.view = map.current;
        map.current.changed();
      })
      .then(
        () => set_failed(false),
        () => {
          set_failed(true);
          if (!gone) stop = when_back(() => set_attempt((n) => n + 1));
        },
      );
    return () => {
      gone = true;
      stop();
      if (current_map.view === map.current) current_map.view = null;
      map.current?.close();
      map.current = null;
    };
  }, [attempt]);
  const backdrop = backdrop_version.value;
  const lost = watched_lost();
  useEffect(() => map.current?.changed(), [version, backdrop, lost]);
  const theme = ground.value;
  useEffect(() => {
    map.current?.theme_changed();
  }, [theme]);

  return (
    <div class={sided ? 'mapbox sided' : 'mapbox'} data-testid="map">
      <div class="mapcanvas" ref={target} tabindex={0} role="application" aria-label={label} />
      <canvas class="overlay" ref={overlay} aria-hidden="true" data-testid="range-lines" />
      <canvas class="overlay" ref={top} aria-hidden="true" data-testid="anchor-ellipses" />
      {failed && (
        <p class="mapfail">
          The map could not be loaded; everything is in the tables. It comes as soon as the link is back.
        </p>
      )}
      <div class="mapui">
        <div class="mgrp">
          <button class="mb" aria-label="Zoom in" onClick={() => map.current?.zoom(1)}>
            <Icon name="plus" />
          </button>
          <button class="mb" aria-label="Zoom out" onClick={() => map.current?.zoom(-1)}>
            <Icon name="minus" />
          </button>
        </div>
        {follow && (
          <button
            class={mode === 'follow' ? 'mb on' : 'mb'}
            aria-label="Follow drone"
            aria-pressed={mode === 'follow'}
            onClick={() => map.current?.mode('follow')}
          >
            <Icon name="centre" />
          </button>
        )}
        <button
          class={mode === 'fit' ? 'mb on' : 'mb'}
          aria-label="Fit everything"
          aria-pressed={mode === 'fit'}
          onClick={() => map.current?.mode('fit')}
        >
          <Icon name="fit" />
        </button>
        <button
          class={sided ? 'mb on' : 'mb'}
          aria-label="Side elevation"
          aria-pressed={sided}
          data-testid="show-elevation"
          onClick={() => (elevation_shown.value = !sided)}
        >
          <Icon name="side" />
        </button>
      </div>
      <LevelChoice />
      <ScaleBars {...scale} />
      {sided && <Elevation content={content} onSelect={onSelect} version={version} zero={zero} />}
    </div>
  );
}

function ScaleBars({ px_per_m, magnified }: { px_per_m: number; magnified: number }) {
  if (!px_per_m) return null;
  const ground_m = round_length(130 / px_per_m),
    ellipse_m = round_length(60 / px_per_m / magnified);
  return (
    <div class="scalebar" data-testid="scale">
      <span class="sb">
        <i style={{ width: `${ground_m * px_per_m}px` }} />
        {length_words(ground_m)}
      </span>
      {magnified > 1 && (
        <span class="sb e">
          <i style={{ width: `${ellipse_m * px_per_m * magnified}px` }} />
          {length_words(ellipse_m)} in ellipses (×{magnified})
        </span>
      )}
      <span class="north">
        <svg viewBox="0 0 14 18" aria-hidden="true">
          <path d="M7 1l5 8H8.4v8H5.6V9H2z" fill="currentColor" />
        </svg>
        N
      </span>
    </div>
  );
}
