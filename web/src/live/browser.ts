import type { Environment, Socket } from './client';

/// The real world for LiveClient: this page's own server, this machine's clocks.
export function browser_environment(path = 'api/v1/ws'): Environment {
  return {
    open: () => {
      const url = new URL(path, document.baseURI.split('#')[0]);
      url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
      return new WebSocket(url, 'anchord.v1') as unknown as Socket;
    },
    now_ms: () => performance.now(),
    wall_us: () => Date.now() * 1000,
    random: Math.random,
    after: (ms, call) => {
      const timer = setTimeout(call, ms);
      return () => clearTimeout(timer);
    },
  };
}
