/// Lists without rows. A list says that it is empty only where the server has said so; else it says that it is not loaded.
import type { ComponentChildren } from 'preact';
import { useEffect } from 'preact/hooks';
import type { LinkState } from '../live/source';
import { link, when_back } from '../state/store';
import { useStable } from './use_stable';

/// `failed`: it was asked for, and no answer came.
export const not_loaded_words = (state: LinkState, failed = false): string =>
  state === 'lost' || (failed && state !== 'live')
    ? 'Not loaded: no connection to the server.'
    : failed
      ? 'Not loaded.'
      : 'Loading.';

export const NotLoaded = ({ failed = false, cls = 'why' }: { failed?: boolean | undefined; cls?: string }) => (
  <p class={cls} role="status" data-testid="not-loaded">
    {not_loaded_words(link.value, failed)}
  </p>
);

/// What is said where a list would be; `loaded`: the server has said that it has no rows.
export const Empty = ({
  loaded,
  failed,
  cls = 'why',
  children,
}: {
  loaded: boolean;
  failed?: boolean;
  cls?: string;
  children: ComponentChildren;
}) => (loaded ? <p class={cls}>{children}</p> : <NotLoaded failed={failed} cls={cls} />);

/// Loads with the view, and again every time the link has come back.
export function useLoad(load: () => void): void {
  const again = useStable(load);
  useEffect(() => {
    again();
    return when_back(again);
  }, [again]);
}
