import { useCallback, useRef } from 'preact/hooks';

/// The same function from render to render, which calls the newest `f`: an effect or timer may depend on it without
/// starting anew because a closure did.
export function useStable<A extends unknown[], R>(f: (...args: A) => R): (...args: A) => R {
  const newest = useRef(f);
  newest.current = f;
  return useCallback((...args: A) => newest.current(...args), []);
}
