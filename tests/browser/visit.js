// The first steps were dismissed at an earlier visit, unless a test says that there was none.
try {
    if (!window.firstVisit) localStorage.setItem("katana450.welcome", "done");
} catch {}
