// Saves what the server has recorded. Loaded on first use.
let working = false;

// `toast` shows a sentence to the person. `query` names the part: its last seconds, or begin and end.
export async function keep(toast, query) {
  if (working) return;
  working = true;
  toast("The recording is being made.");
  try {
    const answer = await fetch(`api/v1/recording?${new URLSearchParams(query)}`);
    if (!answer.ok) throw new Error(await answer.text());
    const link = document.createElement("a");
    link.href = URL.createObjectURL(await answer.blob());
    link.download = `katana450-${new Date().toISOString().slice(0, 19).replaceAll(":", "-")}.mcap`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href));
    toast(`The recording is saved as ${link.download}.`);
  } catch (error) {
    toast(`Nothing was saved: ${error.message}`);
  } finally {
    working = false;
  }
}
