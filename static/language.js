// The language of the page, set before it draws, as its theme: the one chosen in the menu, otherwise the first of the
// browser's languages that has a catalogue. The texts in the code are English.
import { storage } from "./page/storage.js";
import "./theme.js";

const KEY = "katana450.language";
const TAGS = ["en", "de", "fr", "zh"];
const kept = storage(() => localStorage);
const wanted = [kept.getItem(KEY) ?? "", ...navigator.languages].map((tag) => tag.slice(0, 2));
document.documentElement.lang = wanted.find((tag) => TAGS.includes(tag)) ?? "en";
