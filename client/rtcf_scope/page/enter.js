// Takes the token out of the address bar and the history before anything else is loaded, and
// exchanges it for a session; `server.js` waits for that.
{
  const token = new URLSearchParams(location.search).get("token");
  if (token !== null) {
    history.replaceState(null, "", location.pathname + location.hash);
    window.entering = Promise.resolve().then(() => fetch("/api/session", {
      method: "POST", headers: { Authorization: `Bearer ${token}` },
    }));
  }
}
