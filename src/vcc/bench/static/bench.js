async function Ne(r,i){let e=new Blob([r]).stream().pipeThrough(i);return new Uint8Array(await new Response(e).arrayBuffer())}async function Ue(r){let i=new TextEncoder().encode(JSON.stringify(r)),e=await Ne(i,new CompressionStream("deflate-raw")),t="";for(let s of e)t+=String.fromCharCode(s);return"#d="+btoa(t).replaceAll("+","-").replaceAll("/","_").replace(/=+$/,"")}async function ce(r){let i=/^#d=([\w-]+)$/.exec(r);if(!i)return null;try{let e=atob(i[1].replaceAll("-","+").replaceAll("_","/")),t=Uint8Array.from(e,n=>n.charCodeAt(0)),s=await Ne(t,new DecompressionStream("deflate-raw"));return JSON.parse(new TextDecoder().decode(s))}catch{return null}}var At=150,Et=250,Mt=2e5,ee=class extends EventTarget{constructor(e,t={}){super();this.host=e;this.options=t;this.open=!1;this.wasOpen=!1;this.parts=null;this.document=null;this.side=null;this.notes=[];this.canUndo=!1;this.canRedo=!1;this.selected="sensor";this.picture=null;this.pinned=null;this.value=null;this.views=null;this.without=null;this.refused=null;this.progress=null;this.answer=null;this.waiting=!1;this.turn=0;this.selectAt=1/0;this.selectThen="sensor";this.accepted=null;this.next=null;this.underway=0;this.timer=0;this.addressTimer=0;this.pictures=0;this.latestPicture=0;this.valueUnderway=!1;this.nextValue=null;this.addressChanged=async()=>{let e=await ce(window.location.hash);e&&this.act({do:"load",document:e})};e.onmessage=(s,n)=>{this.hear(s,n)},e.onstate=s=>{this.connection(s)}}start(){this.options.address&&window.addEventListener("hashchange",this.addressChanged),this.host.start()}close(){window.removeEventListener("hashchange",this.addressChanged),window.clearTimeout(this.timer),window.clearTimeout(this.addressTimer),this.host.close()}set(e,t,s=!1){this.document&&(this.document=_t(this.document,e,t)),s?(this.next={where:e,value:t},this.underway||this.sendNext()):(this.next=null,this.settle(),this.ask({do:"set",where:e,value:t,moving:!1})),this.changed()}act(e,t){this.next=null,this.settle(),this.ask(e,t),this.changed()}add(e,t){this.selectThen=this.elements.length,this.act({do:"add",kind:e,z:t}),this.selectAt=this.turn}duplicate(e){this.selectThen=e+1,this.act({do:"duplicate",element:e}),this.selectAt=this.turn}askValue(e,t){this.nextValue=[e,t],!this.valueUnderway&&(this.valueUnderway=!0,this.host.send({do:"value",x:e,y:t}),this.nextValue=null)}question(e,t={}){this.host.send({do:"ask",what:e,...t})}export(e,t={}){this.host.send({do:"export",what:e,...t})}pin(e){this.host.send({do:"pin",on:e}),e||(this.pinned=null,this.changed())}select(e){this.selected!==e&&(this.selected=e,this.changed())}forgive(){this.refused=null,this.changed()}get elements(){return this.document?.camera.elements??[]}partOf(e){return e==="light field"?this.side?.aperture??void 0:e==="sensor"?this.side?.sensor:this.side?.elements[e]}whereOf(e){return e==="light field"?["aperture"]:e==="sensor"?["sensor"]:["elements",e]}notesOf(e){return this.notes.filter(t=>t.element===e)}async connection(e){if(this.open=e==="open",this.settle(),this.valueUnderway=!1,this.open){let t=this.document??(this.options.address?await ce(window.location.hash):null);this.wasOpen=!0,this.ask({do:"hello",...t?{document:t}:{}})}else this.progress=null,this.waiting=!1;this.changed()}async hear(e,t){switch(e.is){case"parts":this.parts=e;break;case"state":this.side=e.side,this.views=e.grid?[e.grid[0],e.grid[1]]:null,this.canUndo=e.undo,this.canRedo=e.redo,this.accepted=e.document,e.turn>=this.turn&&!this.next&&(this.document=e.document,this.keepAddress()),e.turn>=this.selectAt&&(this.selectAt=1/0,this.selected=this.selectThen),typeof this.selected=="number"&&this.selected>=this.side.elements.length&&(this.selected=this.side.elements.length?this.side.elements.length-1:"sensor");break;case"notes":e.turn>=this.turn&&(this.notes=e.notes);break;case"no picture":this.without=e.words,this.waiting=!1,this.progress=null,this.settle(),this.sendNext();break;case"failed":this.refused={words:e.words,where:null},this.waiting=!1,this.progress=null,this.settle(),this.sendNext();break;case"picture":e.turn>=this.turn&&!e.coarse&&(this.waiting=!1),this.without=null,this.progress=null,e.turn>=this.underway&&(this.settle(),this.sendNext()),await this.show(e,t[0]);break;case"pinned":this.pinned?.close(),this.pinned=t[0]?await De(t[0]):null,this.picture&&(this.picture.about={...this.picture.about,same:this.pinned!==null});break;case"value":this.value=e,this.valueUnderway=!1,this.nextValue&&this.askValue(...this.nextValue);break;case"answer":for(let s of this.answer?.pictures??[])URL.revokeObjectURL(s);this.answer={message:e,pictures:t.map(s=>URL.createObjectURL(new Blob([pe(s)],{type:"image/jpeg"})))};break;case"file":t[0]&&Tt(e.name,e.type,t[0]),this.progress=null;break;case"refused":this.refused={words:e.words,where:e.where??null},this.selectAt=1/0,this.waiting=!1,this.progress=null,this.valueUnderway=!1,this.settle(),this.next||(this.document=this.accepted),this.sendNext();break;case"progress":this.progress=e.done<e.total?e:null;break}this.changed()}async show(e,t){if(!t)return;let s=++this.pictures,n=await De(t);if(s<this.latestPicture){n.close();return}this.latestPicture=s,this.picture?.bitmap.close(),this.picture={bitmap:n,about:e}}sendNext(){if(!this.next)return;let{where:e,value:t}=this.next;this.next=null,this.ask({do:"set",where:e,value:t,moving:!0}),this.underway=this.turn,this.timer=window.setTimeout(()=>{this.underway=0,this.sendNext()},At)}settle(){window.clearTimeout(this.timer),this.underway=0}ask(e,t){this.turn+=1,this.refused=null,this.waiting=this.open,this.host.send({...e,turn:this.turn},t)}changed(){this.dispatchEvent(new Event("change"))}keepAddress(){this.options.address&&(window.clearTimeout(this.addressTimer),this.addressTimer=window.setTimeout(async()=>{if(!this.document)return;let{pathname:e,search:t}=window.location,s=await Ue(this.document);window.history.replaceState(null,"",e+t+(s.length<Mt?s:""))},Et))}};function _t(r,i,e){let t=i[0]==="elements"||i[0]==="sensor";return de(r,t?["camera",...i]:i,e,t)}function de(r,i,e,t){if(!i.length)return e;let[s,...n]=i;if(Array.isArray(r))return r.map((a,l)=>l===s?de(a,n,e,t):a);if(typeof r!="object"||r===null)return r;let o={...r,[s]:de(r[s]??null,n,e,t)};return t&&o[s]===null&&delete o[s],o}function pe(r){return new Uint8Array(r.buffer,r.byteOffset,r.byteLength)}function De(r){return createImageBitmap(new Blob([pe(r)],{type:"image/jpeg"}))}function Tt(r,i,e){let t=URL.createObjectURL(new Blob([pe(e)],{type:i})),s=document.createElement("a");s.href=t,s.download=r,s.click(),window.setTimeout(()=>URL.revokeObjectURL(t),1e4)}function Pt(r,i=[]){let e=new TextEncoder().encode(JSON.stringify({...r,buffers:i.map(o=>o.byteLength)})),t=i.reduce((o,a)=>o+a.byteLength,4+e.length),s=new Uint8Array(t);new DataView(s.buffer).setUint32(0,e.length,!0),s.set(e,4);let n=4+e.length;for(let o of i)s.set(new Uint8Array(o),n),n+=o.byteLength;return s.buffer}function Ot(r){let i=new DataView(r).getUint32(0,!0),e=JSON.parse(new TextDecoder().decode(new Uint8Array(r,4,i))),t=4+i,s=(e.buffers??[]).map(n=>{let o=new DataView(r,t,n);return t+=n,o});return{message:e,buffers:s}}var Ie=300,Ct=3e3,te=class{constructor(i){this.address=i;this.onmessage=()=>{};this.onstate=()=>{};this.socket=null;this.wait=Ie;this.timer=0;this.ended=!1;this.key=""}start(){let i=new URL(this.address);this.key&&i.searchParams.set("key",this.key);let e=new WebSocket(i);e.binaryType="arraybuffer",this.socket=e,e.onopen=()=>{this.wait=Ie,this.onstate("open")},e.onmessage=t=>{let{message:s,buffers:n}=Ot(t.data);s.is==="key"?this.key=s.key:this.onmessage(s,n)},e.onclose=()=>{this.socket=null,!this.ended&&(this.onstate("closed"),this.timer=window.setTimeout(()=>this.start(),this.wait),this.wait=Math.min(2*this.wait,Ct))}}send(i,e=[]){this.socket?.readyState===WebSocket.OPEN&&this.socket.send(Pt(i,e))}close(){this.ended=!0,window.clearTimeout(this.timer),this.socket?.close()}},ie=class{constructor(i){this.model=i;this.onmessage=()=>{};this.onstate=()=>{};this.hears=(i,e)=>this.onmessage(i,e??[])}start(){this.model.on("msg:custom",this.hears),this.onstate("open")}send(i,e=[]){this.model.send(i,void 0,e)}close(){this.model.off("msg:custom",this.hears)}};/**
 * @license
 * Copyright 2019 Google LLC
 * SPDX-License-Identifier: BSD-3-Clause
 */var se=globalThis,ne=se.ShadowRoot&&(se.ShadyCSS===void 0||se.ShadyCSS.nativeShadow)&&"adoptedStyleSheets"in Document.prototype&&"replace"in CSSStyleSheet.prototype,ue=Symbol(),Be=new WeakMap,V=class{constructor(i,e,t){if(this._$cssResult$=!0,t!==ue)throw Error("CSSResult is not constructable. Use `unsafeCSS` or `css` instead.");this.cssText=i,this.t=e}get styleSheet(){let i=this.o,e=this.t;if(ne&&i===void 0){let t=e!==void 0&&e.length===1;t&&(i=Be.get(e)),i===void 0&&((this.o=i=new CSSStyleSheet).replaceSync(this.cssText),t&&Be.set(e,i))}return i}toString(){return this.cssText}},We=r=>new V(typeof r=="string"?r:r+"",void 0,ue),k=(r,...i)=>{let e=r.length===1?r[0]:i.reduce((t,s,n)=>t+(o=>{if(o._$cssResult$===!0)return o.cssText;if(typeof o=="number")return o;throw Error("Value passed to 'css' function must be a 'css' function result: "+o+". Use 'unsafeCSS' to pass non-literal values, but take care to ensure page security.")})(s)+r[n+1],r[0]);return new V(e,r,ue)},Fe=(r,i)=>{if(ne)r.adoptedStyleSheets=i.map(e=>e instanceof CSSStyleSheet?e:e.styleSheet);else for(let e of i){let t=document.createElement("style"),s=se.litNonce;s!==void 0&&t.setAttribute("nonce",s),t.textContent=e.cssText,r.appendChild(t)}},me=ne?r=>r:r=>r instanceof CSSStyleSheet?(i=>{let e="";for(let t of i.cssRules)e+=t.cssText;return We(e)})(r):r;/**
 * @license
 * Copyright 2017 Google LLC
 * SPDX-License-Identifier: BSD-3-Clause
 */var{is:Lt,defineProperty:Rt,getOwnPropertyDescriptor:zt,getOwnPropertyNames:Ht,getOwnPropertySymbols:Nt,getPrototypeOf:Ut}=Object,re=globalThis,je=re.trustedTypes,Dt=je?je.emptyScript:"",It=re.reactiveElementPolyfillSupport,q=(r,i)=>r,fe={toAttribute(r,i){switch(i){case Boolean:r=r?Dt:null;break;case Object:case Array:r=r==null?r:JSON.stringify(r)}return r},fromAttribute(r,i){let e=r;switch(i){case Boolean:e=r!==null;break;case Number:e=r===null?null:Number(r);break;case Object:case Array:try{e=JSON.parse(r)}catch{e=null}}return e}},qe=(r,i)=>!Lt(r,i),Ve={attribute:!0,type:String,converter:fe,reflect:!1,useDefault:!1,hasChanged:qe};Symbol.metadata??=Symbol("metadata"),re.litPropertyMetadata??=new WeakMap;var M=class extends HTMLElement{static addInitializer(i){this._$Ei(),(this.l??=[]).push(i)}static get observedAttributes(){return this.finalize(),this._$Eh&&[...this._$Eh.keys()]}static createProperty(i,e=Ve){if(e.state&&(e.attribute=!1),this._$Ei(),this.prototype.hasOwnProperty(i)&&((e=Object.create(e)).wrapped=!0),this.elementProperties.set(i,e),!e.noAccessor){let t=Symbol(),s=this.getPropertyDescriptor(i,t,e);s!==void 0&&Rt(this.prototype,i,s)}}static getPropertyDescriptor(i,e,t){let{get:s,set:n}=zt(this.prototype,i)??{get(){return this[e]},set(o){this[e]=o}};return{get:s,set(o){let a=s?.call(this);n?.call(this,o),this.requestUpdate(i,a,t)},configurable:!0,enumerable:!0}}static getPropertyOptions(i){return this.elementProperties.get(i)??Ve}static _$Ei(){if(this.hasOwnProperty(q("elementProperties")))return;let i=Ut(this);i.finalize(),i.l!==void 0&&(this.l=[...i.l]),this.elementProperties=new Map(i.elementProperties)}static finalize(){if(this.hasOwnProperty(q("finalized")))return;if(this.finalized=!0,this._$Ei(),this.hasOwnProperty(q("properties"))){let e=this.properties,t=[...Ht(e),...Nt(e)];for(let s of t)this.createProperty(s,e[s])}let i=this[Symbol.metadata];if(i!==null){let e=litPropertyMetadata.get(i);if(e!==void 0)for(let[t,s]of e)this.elementProperties.set(t,s)}this._$Eh=new Map;for(let[e,t]of this.elementProperties){let s=this._$Eu(e,t);s!==void 0&&this._$Eh.set(s,e)}this.elementStyles=this.finalizeStyles(this.styles)}static finalizeStyles(i){let e=[];if(Array.isArray(i)){let t=new Set(i.flat(1/0).reverse());for(let s of t)e.unshift(me(s))}else i!==void 0&&e.push(me(i));return e}static _$Eu(i,e){let t=e.attribute;return t===!1?void 0:typeof t=="string"?t:typeof i=="string"?i.toLowerCase():void 0}constructor(){super(),this._$Ep=void 0,this.isUpdatePending=!1,this.hasUpdated=!1,this._$Em=null,this._$Ev()}_$Ev(){this._$ES=new Promise(i=>this.enableUpdating=i),this._$AL=new Map,this._$E_(),this.requestUpdate(),this.constructor.l?.forEach(i=>i(this))}addController(i){(this._$EO??=new Set).add(i),this.renderRoot!==void 0&&this.isConnected&&i.hostConnected?.()}removeController(i){this._$EO?.delete(i)}_$E_(){let i=new Map,e=this.constructor.elementProperties;for(let t of e.keys())this.hasOwnProperty(t)&&(i.set(t,this[t]),delete this[t]);i.size>0&&(this._$Ep=i)}createRenderRoot(){let i=this.shadowRoot??this.attachShadow(this.constructor.shadowRootOptions);return Fe(i,this.constructor.elementStyles),i}connectedCallback(){this.renderRoot??=this.createRenderRoot(),this.enableUpdating(!0),this._$EO?.forEach(i=>i.hostConnected?.())}enableUpdating(i){}disconnectedCallback(){this._$EO?.forEach(i=>i.hostDisconnected?.())}attributeChangedCallback(i,e,t){this._$AK(i,t)}_$ET(i,e){let t=this.constructor.elementProperties.get(i),s=this.constructor._$Eu(i,t);if(s!==void 0&&t.reflect===!0){let n=(t.converter?.toAttribute!==void 0?t.converter:fe).toAttribute(e,t.type);this._$Em=i,n==null?this.removeAttribute(s):this.setAttribute(s,n),this._$Em=null}}_$AK(i,e){let t=this.constructor,s=t._$Eh.get(i);if(s!==void 0&&this._$Em!==s){let n=t.getPropertyOptions(s),o=typeof n.converter=="function"?{fromAttribute:n.converter}:n.converter?.fromAttribute!==void 0?n.converter:fe;this._$Em=s;let a=o.fromAttribute(e,n.type);this[s]=a??this._$Ej?.get(s)??a,this._$Em=null}}requestUpdate(i,e,t,s=!1,n){if(i!==void 0){let o=this.constructor;if(s===!1&&(n=this[i]),t??=o.getPropertyOptions(i),!((t.hasChanged??qe)(n,e)||t.useDefault&&t.reflect&&n===this._$Ej?.get(i)&&!this.hasAttribute(o._$Eu(i,t))))return;this.C(i,e,t)}this.isUpdatePending===!1&&(this._$ES=this._$EP())}C(i,e,{useDefault:t,reflect:s,wrapped:n},o){t&&!(this._$Ej??=new Map).has(i)&&(this._$Ej.set(i,o??e??this[i]),n!==!0||o!==void 0)||(this._$AL.has(i)||(this.hasUpdated||t||(e=void 0),this._$AL.set(i,e)),s===!0&&this._$Em!==i&&(this._$Eq??=new Set).add(i))}async _$EP(){this.isUpdatePending=!0;try{await this._$ES}catch(e){Promise.reject(e)}let i=this.scheduleUpdate();return i!=null&&await i,!this.isUpdatePending}scheduleUpdate(){return this.performUpdate()}performUpdate(){if(!this.isUpdatePending)return;if(!this.hasUpdated){if(this.renderRoot??=this.createRenderRoot(),this._$Ep){for(let[s,n]of this._$Ep)this[s]=n;this._$Ep=void 0}let t=this.constructor.elementProperties;if(t.size>0)for(let[s,n]of t){let{wrapped:o}=n,a=this[s];o!==!0||this._$AL.has(s)||a===void 0||this.C(s,void 0,n,a)}}let i=!1,e=this._$AL;try{i=this.shouldUpdate(e),i?(this.willUpdate(e),this._$EO?.forEach(t=>t.hostUpdate?.()),this.update(e)):this._$EM()}catch(t){throw i=!1,this._$EM(),t}i&&this._$AE(e)}willUpdate(i){}_$AE(i){this._$EO?.forEach(e=>e.hostUpdated?.()),this.hasUpdated||(this.hasUpdated=!0,this.firstUpdated(i)),this.updated(i)}_$EM(){this._$AL=new Map,this.isUpdatePending=!1}get updateComplete(){return this.getUpdateComplete()}getUpdateComplete(){return this._$ES}shouldUpdate(i){return!0}update(i){this._$Eq&&=this._$Eq.forEach(e=>this._$ET(e,this[e])),this._$EM()}updated(i){}firstUpdated(i){}};M.elementStyles=[],M.shadowRootOptions={mode:"open"},M[q("elementProperties")]=new Map,M[q("finalized")]=new Map,It?.({ReactiveElement:M}),(re.reactiveElementVersions??=[]).push("2.1.2");/**
 * @license
 * Copyright 2017 Google LLC
 * SPDX-License-Identifier: BSD-3-Clause
 */var xe=globalThis,Ke=r=>r,oe=xe.trustedTypes,Ge=oe?oe.createPolicy("lit-html",{createHTML:r=>r}):void 0,et="$lit$",P=`lit$${Math.random().toFixed(9).slice(2)}$`,tt="?"+P,Bt=`<${tt}>`,z=document,G=()=>z.createComment(""),Z=r=>r===null||typeof r!="object"&&typeof r!="function",ke=Array.isArray,Wt=r=>ke(r)||typeof r?.[Symbol.iterator]=="function",ge=`[ 	
\f\r]`,K=/<(?:(!--|\/[^a-zA-Z])|(\/?[a-zA-Z][^>\s]*)|(\/?$))/g,Ze=/-->/g,Je=/>/g,L=RegExp(`>|${ge}(?:([^\\s"'>=/]+)(${ge}*=${ge}*(?:[^ 	
\f\r"'\`<>=]|("|')|))|$)`,"g"),Qe=/'/g,Ye=/"/g,it=/^(?:script|style|textarea|title)$/i,Se=r=>(i,...e)=>({_$litType$:r,strings:i,values:e}),p=Se(1),b=Se(2),Bi=Se(3),H=Symbol.for("lit-noChange"),u=Symbol.for("lit-nothing"),Xe=new WeakMap,R=z.createTreeWalker(z,129);function st(r,i){if(!ke(r)||!r.hasOwnProperty("raw"))throw Error("invalid template strings array");return Ge!==void 0?Ge.createHTML(i):i}var Ft=(r,i)=>{let e=r.length-1,t=[],s,n=i===2?"<svg>":i===3?"<math>":"",o=K;for(let a=0;a<e;a++){let l=r[a],h,c,d=-1,m=0;for(;m<l.length&&(o.lastIndex=m,c=o.exec(l),c!==null);)m=o.lastIndex,o===K?c[1]==="!--"?o=Ze:c[1]!==void 0?o=Je:c[2]!==void 0?(it.test(c[2])&&(s=RegExp("</"+c[2],"g")),o=L):c[3]!==void 0&&(o=L):o===L?c[0]===">"?(o=s??K,d=-1):c[1]===void 0?d=-2:(d=o.lastIndex-c[2].length,h=c[1],o=c[3]===void 0?L:c[3]==='"'?Ye:Qe):o===Ye||o===Qe?o=L:o===Ze||o===Je?o=K:(o=L,s=void 0);let f=o===L&&r[a+1].startsWith("/>")?" ":"";n+=o===K?l+Bt:d>=0?(t.push(h),l.slice(0,d)+et+l.slice(d)+P+f):l+P+(d===-2?a:f)}return[st(r,n+(r[e]||"<?>")+(i===2?"</svg>":i===3?"</math>":"")),t]},J=class r{constructor({strings:i,_$litType$:e},t){let s;this.parts=[];let n=0,o=0,a=i.length-1,l=this.parts,[h,c]=Ft(i,e);if(this.el=r.createElement(h,t),R.currentNode=this.el.content,e===2||e===3){let d=this.el.content.firstChild;d.replaceWith(...d.childNodes)}for(;(s=R.nextNode())!==null&&l.length<a;){if(s.nodeType===1){if(s.hasAttributes())for(let d of s.getAttributeNames())if(d.endsWith(et)){let m=c[o++],f=s.getAttribute(d).split(P),g=/([.?@])?(.*)/.exec(m);l.push({type:1,index:n,name:g[2],strings:f,ctor:g[1]==="."?ve:g[1]==="?"?$e:g[1]==="@"?ye:D}),s.removeAttribute(d)}else d.startsWith(P)&&(l.push({type:6,index:n}),s.removeAttribute(d));if(it.test(s.tagName)){let d=s.textContent.split(P),m=d.length-1;if(m>0){s.textContent=oe?oe.emptyScript:"";for(let f=0;f<m;f++)s.append(d[f],G()),R.nextNode(),l.push({type:2,index:++n});s.append(d[m],G())}}}else if(s.nodeType===8)if(s.data===tt)l.push({type:2,index:n});else{let d=-1;for(;(d=s.data.indexOf(P,d+1))!==-1;)l.push({type:7,index:n}),d+=P.length-1}n++}}static createElement(i,e){let t=z.createElement("template");return t.innerHTML=i,t}};function U(r,i,e=r,t){if(i===H)return i;let s=t!==void 0?e._$Co?.[t]:e._$Cl,n=Z(i)?void 0:i._$litDirective$;return s?.constructor!==n&&(s?._$AO?.(!1),n===void 0?s=void 0:(s=new n(r),s._$AT(r,e,t)),t!==void 0?(e._$Co??=[])[t]=s:e._$Cl=s),s!==void 0&&(i=U(r,s._$AS(r,i.values),s,t)),i}var be=class{constructor(i,e){this._$AV=[],this._$AN=void 0,this._$AD=i,this._$AM=e}get parentNode(){return this._$AM.parentNode}get _$AU(){return this._$AM._$AU}u(i){let{el:{content:e},parts:t}=this._$AD,s=(i?.creationScope??z).importNode(e,!0);R.currentNode=s;let n=R.nextNode(),o=0,a=0,l=t[0];for(;l!==void 0;){if(o===l.index){let h;l.type===2?h=new Q(n,n.nextSibling,this,i):l.type===1?h=new l.ctor(n,l.name,l.strings,this,i):l.type===6&&(h=new we(n,this,i)),this._$AV.push(h),l=t[++a]}o!==l?.index&&(n=R.nextNode(),o++)}return R.currentNode=z,s}p(i){let e=0;for(let t of this._$AV)t!==void 0&&(t.strings!==void 0?(t._$AI(i,t,e),e+=t.strings.length-2):t._$AI(i[e])),e++}},Q=class r{get _$AU(){return this._$AM?._$AU??this._$Cv}constructor(i,e,t,s){this.type=2,this._$AH=u,this._$AN=void 0,this._$AA=i,this._$AB=e,this._$AM=t,this.options=s,this._$Cv=s?.isConnected??!0}get parentNode(){let i=this._$AA.parentNode,e=this._$AM;return e!==void 0&&i?.nodeType===11&&(i=e.parentNode),i}get startNode(){return this._$AA}get endNode(){return this._$AB}_$AI(i,e=this){i=U(this,i,e),Z(i)?i===u||i==null||i===""?(this._$AH!==u&&this._$AR(),this._$AH=u):i!==this._$AH&&i!==H&&this._(i):i._$litType$!==void 0?this.$(i):i.nodeType!==void 0?this.T(i):Wt(i)?this.k(i):this._(i)}O(i){return this._$AA.parentNode.insertBefore(i,this._$AB)}T(i){this._$AH!==i&&(this._$AR(),this._$AH=this.O(i))}_(i){this._$AH!==u&&Z(this._$AH)?this._$AA.nextSibling.data=i:this.T(z.createTextNode(i)),this._$AH=i}$(i){let{values:e,_$litType$:t}=i,s=typeof t=="number"?this._$AC(i):(t.el===void 0&&(t.el=J.createElement(st(t.h,t.h[0]),this.options)),t);if(this._$AH?._$AD===s)this._$AH.p(e);else{let n=new be(s,this),o=n.u(this.options);n.p(e),this.T(o),this._$AH=n}}_$AC(i){let e=Xe.get(i.strings);return e===void 0&&Xe.set(i.strings,e=new J(i)),e}k(i){ke(this._$AH)||(this._$AH=[],this._$AR());let e=this._$AH,t,s=0;for(let n of i)s===e.length?e.push(t=new r(this.O(G()),this.O(G()),this,this.options)):t=e[s],t._$AI(n),s++;s<e.length&&(this._$AR(t&&t._$AB.nextSibling,s),e.length=s)}_$AR(i=this._$AA.nextSibling,e){for(this._$AP?.(!1,!0,e);i!==this._$AB;){let t=Ke(i).nextSibling;Ke(i).remove(),i=t}}setConnected(i){this._$AM===void 0&&(this._$Cv=i,this._$AP?.(i))}},D=class{get tagName(){return this.element.tagName}get _$AU(){return this._$AM._$AU}constructor(i,e,t,s,n){this.type=1,this._$AH=u,this._$AN=void 0,this.element=i,this.name=e,this._$AM=s,this.options=n,t.length>2||t[0]!==""||t[1]!==""?(this._$AH=Array(t.length-1).fill(new String),this.strings=t):this._$AH=u}_$AI(i,e=this,t,s){let n=this.strings,o=!1;if(n===void 0)i=U(this,i,e,0),o=!Z(i)||i!==this._$AH&&i!==H,o&&(this._$AH=i);else{let a=i,l,h;for(i=n[0],l=0;l<n.length-1;l++)h=U(this,a[t+l],e,l),h===H&&(h=this._$AH[l]),o||=!Z(h)||h!==this._$AH[l],h===u?i=u:i!==u&&(i+=(h??"")+n[l+1]),this._$AH[l]=h}o&&!s&&this.j(i)}j(i){i===u?this.element.removeAttribute(this.name):this.element.setAttribute(this.name,i??"")}},ve=class extends D{constructor(){super(...arguments),this.type=3}j(i){this.element[this.name]=i===u?void 0:i}},$e=class extends D{constructor(){super(...arguments),this.type=4}j(i){this.element.toggleAttribute(this.name,!!i&&i!==u)}},ye=class extends D{constructor(i,e,t,s,n){super(i,e,t,s,n),this.type=5}_$AI(i,e=this){if((i=U(this,i,e,0)??u)===H)return;let t=this._$AH,s=i===u&&t!==u||i.capture!==t.capture||i.once!==t.once||i.passive!==t.passive,n=i!==u&&(t===u||s);s&&this.element.removeEventListener(this.name,this,t),n&&this.element.addEventListener(this.name,this,i),this._$AH=i}handleEvent(i){typeof this._$AH=="function"?this._$AH.call(this.options?.host??this.element,i):this._$AH.handleEvent(i)}},we=class{constructor(i,e,t){this.element=i,this.type=6,this._$AN=void 0,this._$AM=e,this.options=t}get _$AU(){return this._$AM._$AU}_$AI(i){U(this,i)}};var jt=xe.litHtmlPolyfillSupport;jt?.(J,Q),(xe.litHtmlVersions??=[]).push("3.3.3");var nt=(r,i,e)=>{let t=e?.renderBefore??i,s=t._$litPart$;if(s===void 0){let n=e?.renderBefore??null;t._$litPart$=s=new Q(i.insertBefore(G(),n),n,void 0,e??{})}return s._$AI(r),s};/**
 * @license
 * Copyright 2017 Google LLC
 * SPDX-License-Identifier: BSD-3-Clause
 */var Ae=globalThis,O=class extends M{constructor(){super(...arguments),this.renderOptions={host:this},this._$Do=void 0}createRenderRoot(){let i=super.createRenderRoot();return this.renderOptions.renderBefore??=i.firstChild,i}update(i){let e=this.render();this.hasUpdated||(this.renderOptions.isConnected=this.isConnected),super.update(i),this._$Do=nt(e,this.renderRoot,this.renderOptions)}connectedCallback(){super.connectedCallback(),this._$Do?.setConnected(!0)}disconnectedCallback(){super.disconnectedCallback(),this._$Do?.setConnected(!1)}render(){return H}};O._$litElement$=!0,O.finalized=!0,Ae.litElementHydrateSupport?.({LitElement:O});var Vt=Ae.litElementPolyfillSupport;Vt?.({LitElement:O});(Ae.litElementVersions??=[]).push("4.2.2");/**
 * @license
 * Copyright 2022 Google LLC
 * SPDX-License-Identifier: BSD-3-Clause
 */var S=class extends O{constructor(){super(...arguments);this.follow=()=>this.requestUpdate()}static{this.properties={bench:{attribute:!1}}}connectedCallback(){super.connectedCallback(),this.bench.addEventListener("change",this.follow)}disconnectedCallback(){super.disconnectedCallback(),this.bench.removeEventListener("change",this.follow)}};function I(r,i){customElements.get(r)||customElements.define(r,i)}var C=k`
  :host {
    font: 400 13px/1.4 system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", sans-serif;
    font-variant-numeric: tabular-nums;
    color: var(--ink);
    box-sizing: border-box;
  }
  *, *::before, *::after { box-sizing: border-box; }
  button, select, input, textarea, summary, .button {
    font: inherit;
    font-variant-numeric: tabular-nums;
    color: inherit;
  }
  button, select, summary, .button {
    height: 28px;
    padding: 0 9px;
    border: 1px solid transparent;
    border-radius: 6px;
    background: transparent;
    cursor: pointer;
    white-space: nowrap;
    display: inline-flex;
    align-items: center;
    justify-content: center;
    gap: 6px;
    list-style: none;
  }
  summary::-webkit-details-marker { display: none; }
  select { appearance: none; padding-right: 22px; background: var(--arrow) no-repeat right 8px center; }
  button:hover:not(:disabled), select:hover, summary:hover, .button:hover { background-color: var(--hover); }
  button:disabled { color: var(--faint); cursor: default; }
  button[aria-pressed="true"], button[aria-selected="true"] { background: var(--chosen); color: var(--accent); }
  .icon { padding: 0; width: 28px; }
  svg.sign { width: 16px; height: 16px; fill: none; stroke: currentColor; stroke-width: 1.5; stroke-linecap: round; stroke-linejoin: round; flex: none; }
  input[type="text"], input[type="number"], textarea, .field select {
    height: 28px;
    min-width: 0;
    padding: 0 8px;
    border: 1px solid var(--line);
    border-radius: 6px;
    background-color: var(--well);
  }
  .field select { padding-right: 22px; }
  textarea { height: auto; padding: 6px 8px; resize: vertical; }
  input:hover, textarea:hover { border-color: var(--edge); }
  input[type="checkbox"] { width: 16px; height: 16px; margin: 0; accent-color: var(--accent); }
  :focus { outline: none; }
  :focus-visible { outline: 2px solid var(--accent); outline-offset: 1px; }
  label.check { display: inline-flex; align-items: center; gap: 7px; height: 28px; cursor: pointer; white-space: nowrap; }
  .quiet { color: var(--quiet); }
  .hidden { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); white-space: nowrap; }
`;var qt={nm:1e-9,um:1e-6,µm:1e-6,μm:1e-6,mm:.001,cm:.01,m:1},Kt=/^\s*([-+−]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s].*?)?\s*$/;function N(r){let i=Kt.exec(r);return i?{number:Number(i[1].replace("−","-").replace(",",".")),unit:i[2]??""}:null}function Y(r){if(typeof r=="number")return r;let i=N(String(r)),e=i&&qt[i.unit];return i&&e?i.number*e:NaN}function v(r,i=6){if(!Number.isFinite(r))return r>0?"∞":r<0?"−∞":"–";let e=Number(r.toPrecision(i));return Math.abs(e)>=1e-6||e===0?e.toString():e.toExponential()}function _(r){return`${Number((r*1e3).toFixed(6))+0} mm`}function B(r,i=4){let e=Math.abs(r);return Number.isFinite(r)?e>=1?`${v(r,i)} m`:e>=1e-4||e===0?`${v(r*1e3,i)} mm`:`${v(r*1e6,i)} µm`:"∞"}function T(r,i,e){let t=N(r);if(!t)return r;let s=t.unit||typeof i=="string"&&N(i)?.unit||e;return`${t.number}${s?` ${s}`:""}`}function rt(r,i){let e=N(r);if(!e)return null;let t=Math.abs(e.number),s=t===0?.1:10**(Math.floor(Math.log10(t))-1);return`${Number((e.number+i*s).toPrecision(10))}${e.unit?` ${e.unit}`:""}`}function Ee(r){return 10**Math.floor(Math.log10(Math.max(r,1e-9)/500))}var Gt={length:"mm",angle:"deg",time:"ms"},Me="drawn cells",ot="picture file …",Zt=[[1,0,1,0,1],[0,1,0,1,0],[1,0,1,0,1],[0,1,0,1,0],[1,0,1,0,1]],at=33,Jt=500,Qt=["z"],Yt=["name","decentre"];function X(r,i,e,t){let s=({name:n})=>Qt.includes(n)?-1:Yt.indexOf(n)+1;return[...i].sort((n,o)=>s(n)-s(o)).map(n=>Xt(r,n,e[n.name]??null,[...t,n.name]))}function Xt(r,i,e,t){let s=i.family?r.parts?.families[i.family]:void 0;return s?si(r,i,s,e,t):i.parameters?ii(r,i,i.parameters,e,t):Te(r,i,t,ei(r,i,e,t))}function Te(r,i,e,t){let s=e.join("-"),n=r.refused?.where?.join("-")===s?r.refused.words:null;return p`<div class="field">
    <label for=${s} title=${i.words}>${i.name.replaceAll("_"," ")}</label>
    ${t}
    ${n?p`<p class="wrong" role="alert">${n}</p>`:u}
  </div>`}function ei(r,i,e,t){let s=t.join("-"),{takes:n,choices:o}=i;if(n.includes("truth"))return p`<input id=${s} type="checkbox" .checked=${(e??i.default)===!0}
      @change=${a=>r.set(t,a.target.checked)}>`;if(o.length){let a=e??i.default;return p`<select id=${s} @change=${l=>r.set(t,l.target.value)}>
      ${o.map(l=>p`<option value=${l} ?selected=${l===a}>${l}</option>`)}</select>`}return n.includes("array")?lt(r,e,t,s):W(e)||Array.isArray(e)&&e.some(a=>typeof a=="object")?p`<output id=${s} class="quiet">${E(e)}</output>`:ti(r,i,e,t)}function ti(r,i,e,t){let s=e??i.default,n=i.needed?"":i.default===null||i.default===""?"none":E(i.default),o=i.takes.some(c=>c==="number"||c==="whole number"),a=0,l=c=>{let d=c.target;delete d.dataset.edited,window.clearTimeout(a);let m=d.value.trim()===""?null:_e(i,d.value,s);E(m)!==E(e)?r.set(t,m):d.value=E(e)},h=c=>{let d=c.target;c.key==="Escape"&&(d.value=E(e),delete d.dataset.edited,r.forgive());let m={ArrowUp:1,ArrowDown:-1}[c.key];if(!m||!o)return;let f=d.value||E(i.default),w=i.takes.includes("whole number")&&!i.takes.includes("number")?String(Number(f)+m):rt(f,m*(c.shiftKey?10:c.altKey?.1:1));if(w===null)return;c.preventDefault(),d.value=w;let x=_e(i,w,s);r.set(t,x,!0),window.clearTimeout(a),a=window.setTimeout(()=>r.set(t,x),Jt)};return p`<input id=${t.join("-")} type="text" inputmode=${i.takes.includes("text")?"text":"decimal"} autocomplete="off" spellcheck="false"
    .value=${E(e)} placeholder=${n} @input=${c=>c.target.dataset.edited=""}
    @change=${l} @keydown=${h}>`}function ii(r,i,e,t,s){let n=s.join("-");return p`${Te(r,i,s,p`<input id=${n} type="checkbox" .checked=${W(t)} ?disabled=${i.needed&&W(t)}
      @change=${o=>r.set(s,o.target.checked?{}:null)}>`)}
    ${W(t)?p`<div class="inner">${X(r,e,t,s)}</div>`:u}`}function si(r,i,e,t,s){let n=s.join("-"),o=W(t)?t:null,a=ht(t),l=i.family==="pattern"&&i.takes.includes("array"),h=o?String(o.name??""):a?Me:typeof t=="string"?t:Array.isArray(t)?`${t.length} together`:"",c=e.find(f=>f.kind===h),d=[...e.map(f=>f.kind),...l?[Me,ot]:[]];return p`${Te(r,i,s,p`
      <select id=${n} @change=${f=>{let g=f.target,w=g.value;w===ot?(g.nextElementSibling.click(),g.value=h):w===Me?r.set(s,Zt):r.set(s,w===""?null:{name:w})}}>
        ${i.needed?u:p`<option value="" ?selected=${h===""}>none</option>`}
        ${h&&!d.includes(h)?p`<option value=${h} selected>${h}</option>`:u}
        ${d.map(f=>p`<option value=${f} ?selected=${f===h}>${f.replaceAll("_"," ")}</option>`)}
      </select>
      ${l?p`<input type="file" hidden accept="image/*,.npy,.csv,.tif,.exr" aria-label="Picture for the pattern" @change=${f=>{ni(r,s,f.target)}}>`:u}`)}
    ${a?p`<div class="field"><label for="${n}-cells">cells</label>${lt(r,t,s,`${n}-cells`)}</div>`:u}
    ${c&&o?p`<div class="inner">${X(r,c.parameters,o,s)}</div>`:u}`}async function ni(r,i,e){let t=e.files?.[0];t&&r.act({do:"upload",where:i,name:t.name},[await t.arrayBuffer()]),e.value=""}function lt(r,i,e,t){let s=ht(i)?i:null,n=s?.[0]?.length??0;if(!s||s.length>at||n>at)return p`<output id=${t} class="quiet">${s?`${s.length} × ${n} numbers`:E(i)||"none"}</output>`;let o=(h,c)=>r.set(e,s.map((d,m)=>m===h?d.map((f,g)=>g===c?f>.5?0:1:f):d)),a=Math.max(5,Math.min(18,Math.floor(180/n))),l=h=>{let c=h.target.value.trim().split(`
`);r.set(e,c.map(d=>d.trim().split(/[\s,]+/).map(m=>Number.isFinite(Number(m))?Number(m):m)))};return p`<div class="cells">
    ${e.includes("pattern")?p`<div class="grid" aria-hidden="true" style="grid-template-columns: repeat(${n}, ${a}px)">
      ${s.map((h,c)=>h.map((d,m)=>p`<i style="height:${a}px;background:color-mix(in srgb, #fff ${100*Math.min(Math.max(d,0),1)}%, #000)" @click=${()=>o(c,m)}></i>`))}
    </div>`:u}
    <textarea id=${t} rows=${Math.min(s.length,6)} spellcheck="false" .value=${s.map(h=>h.join(" ")).join(`
`)} @change=${l}></textarea>
  </div>`}function W(r){return typeof r=="object"&&r!==null&&!Array.isArray(r)}function ht(r){return Array.isArray(r)&&r.length>0&&r.every(i=>Array.isArray(i)&&i.every(e=>typeof e=="number"))}function E(r){return r==null?"":Array.isArray(r)?r.map(E).join(", "):W(r)?JSON.stringify(r):String(r)}function _e(r,i,e){let{takes:t,unit:s}=r;if(t.includes("list")&&i.includes(","))return i.split(",").map((l,h)=>_e({...r,takes:["number"]},l,Array.isArray(e)?e[h]??null:e));let n=i.trim();if(s)return T(n,Array.isArray(e)?e[0]??null:e,Gt[s]);let o=Number(n.replace("−","-"));return t.some(l=>l!=="text"&&l!=="name")&&n!==""&&Number.isFinite(o)?o:n}var ri={undo:"M6.5 3.5 3 7l3.5 3.5M3.5 7H10a3 3 0 0 1 0 6H8",redo:"M9.5 3.5 13 7l-3.5 3.5M12.5 7H6a3 3 0 0 0 0 6h2",plus:"M8 3.5v9M3.5 8h9",minus:"M3.5 8h9",whole:"M3 6V3h3M10 3h3v3M13 10v3h-3M6 13H3v-3",earlier:"M10 3.5 5.5 8l4.5 4.5",later:"M6 3.5 10.5 8 6 12.5",twice:"M5.5 5.5h7v7h-7zM10.5 3.5h-7v7",away:"M3.5 5h9M6.5 5V3.5h3V5M5 5l.5 8h5l.5-8",down:"M4 6.5 8 10.5 12 6.5",aim:"M8 1.5v4M8 10.5v4M1.5 8h4M10.5 8h4",pin:"M6 2.5h4l-.5 5 2 2h-7l2-2zM8 9.5v4.5"};function $(r){return p`<svg class="sign" viewBox="0 0 16 16" aria-hidden="true">${b`<path d=${ri[r]}></path>`}</svg>`}var Pe=[{name:"z",words:"place of the views' plane on the axis; below 0 before the entrance plane",unit:"length",needed:!1,default:"0 mm",takes:["number"],choices:[]},{name:"decentre",words:"of the views: right, down",unit:"length",needed:!1,default:["0 mm","0 mm"],takes:["list"],choices:[]}],ae=class extends S{typePlace(){let i=this.renderRoot.querySelector('input[id$="-z"]');i?.focus(),i?.select()}updated(){let i=this.renderRoot.querySelector(".chips"),e=i?.querySelector('[aria-selected="true"]');if(!i||!e)return;let t=e.offsetLeft-i.offsetLeft;t<i.scrollLeft?i.scrollLeft=t-8:t+e.offsetWidth>i.scrollLeft+i.clientWidth&&(i.scrollLeft=t+e.offsetWidth-i.clientWidth)}get order(){let i=this.bench.side;return this.bench.elements.map((e,t)=>t).sort((e,t)=>(i?.elements[e]?.z??0)-(i?.elements[t]?.z??0)||e-t)}labelOf(i){if(i==="light field")return"light field";let e=this.bench.partOf(i);return e?e.label[0]??"":i==="sensor"?"sensor":String(this.bench.elements[i]?.kind??"")}render(){let{bench:i}=this;if(!i.document||!i.parts)return u;let e=["light field",...this.order,"sensor"];return p`
      <div class="chips" role="tablist" aria-label="What stands on the bench" @keydown=${this.key}>
        ${e.map(t=>p`<button role="tab" id="tab-${t}" aria-selected=${i.selected===t} aria-controls="form"
          tabindex=${i.selected===t?0:-1} @click=${()=>i.select(t)}>${this.labelOf(t)}${i.notesOf(t).length?p`<i class="note" title="has a note"></i>`:u}</button>`)}
      </div>
      <div class="adds"><select aria-label="Add an element" @change=${this.add}>
        <option value="" selected>+ Add …</option>
        ${i.parts.kinds.map(t=>p`<option value=${t.kind} title=${t.words}>${t.kind.replaceAll("_"," ")}</option>`)}</select></div>
      <div id="form" class="form" role="tabpanel" aria-labelledby="tab-${i.selected}">${this.form()}</div>`}form(){let{selected:i}=this.bench;if(i==="light field")return this.lightField();let e=i==="sensor"?this.bench.document.camera.sensor:this.bench.elements[i],t=i==="sensor"?null:this.kindOf(i),s=i==="sensor"?this.bench.parts.sensor:t?.parameters;return!e||!s?u:p`
      <div class="head"><span class="quiet" title=${t?.words??""}>${[String(e.kind??"").replaceAll("_"," "),...this.bench.partOf(i)?.label.slice(1)??[]].filter(Boolean).join(", ")}</span>${i==="sensor"?u:this.verbs(i)}</div>
      ${this.bench.notesOf(i).map(n=>p`<p class="advice">${n.words}</p>`)}
      ${X(this.bench,s,e,this.bench.whereOf(i))}`}kindOf(i){return this.bench.parts.kinds.find(e=>e.kind===this.bench.elements[i]?.kind)}verbs(i){let e=this.order.indexOf(i),{bench:t}=this;return p`<span class="verbs">
      <button class="icon" title="One place towards the scene" aria-label="Move before the one before it" ?disabled=${e===0} @click=${()=>t.act({do:"reorder",element:i,by:-1})}>${$("earlier")}</button>
      <button class="icon" title="One place towards the sensor" aria-label="Move behind the one behind it" ?disabled=${e===this.order.length-1} @click=${()=>t.act({do:"reorder",element:i,by:1})}>${$("later")}</button>
      <button class="icon" title="Duplicate" aria-label="Duplicate" @click=${()=>t.duplicate(i)}>${$("twice")}</button>
      <button class="icon" title="Remove" aria-label="Remove" @click=${()=>t.act({do:"remove",element:i})}>${$("away")}</button>
    </span>`}lightField(){let{bench:i}=this,e=i.document;return p`
      <div class="field"><label for="light-field">light field</label>
        <select id="light-field" @change=${t=>i.set(["light_field"],t.target.value)}>
          ${i.parts.light_fields.map(t=>p`<option value=${t} ?selected=${t===e.light_field}>${t}</option>`)}</select></div>
      ${i.views?[0,1].map(t=>this.viewRange(t,i.views)):u}
      ${e.views?p`<div class="field"><span></span><button @click=${()=>i.set(["views"],null)}>All views</button></div>`:u}
      <p class="quiet">Where the views stand: before the entrance plane, z = 0, or behind it, right and down of the axis.</p>
      ${X(i,Pe,e.aperture,["aperture"])}`}viewRange(i,e){let t={rows:[0,e[0]-1],columns:[0,e[1]-1]},s=this.bench.document.views??t,n=i===0?"rows":"columns",o=(l,h)=>{let c=[...s[n]];c[l]=Math.min(Math.max(Math.round(Number(h)||0),0),e[i]-1),c[0]>c[1]&&(c[1-l]=c[l]),this.bench.set(["views"],{...s,[n]:c})},a=l=>p`<input type="number" min="0" max=${e[i]-1} aria-label="${l?"last":"first"} of the ${n} of views"
      .value=${String(s[n][l])} @change=${h=>o(l,h.target.value)}>`;return p`<div class="field"><span>${n} of views</span><span class="range">${a(0)}<span class="quiet">to</span>${a(1)}<span class="quiet">of ${e[i]}</span></span></div>`}add(i){let e=i.target,t=e.value;if(e.value="",!t)return;let s=this.bench.side,n=[0,...s?.elements.map(h=>h.z)??[],s?.sensor.z??0].sort((h,c)=>h-c),[o,a]=[n[0],n[n.length-1]],l=-1;for(let h=1;h<n.length;h++)n[h]-n[h-1]>l&&([o,a,l]=[n[h-1],n[h],n[h]-n[h-1]]);this.bench.add(t,_(Math.round((o+a)*5e3)/1e4))}key(i){let e={ArrowRight:1,ArrowLeft:-1}[i.key];if(!e)return;let t=["light field",...this.order,"sensor"],s=t[(t.indexOf(this.bench.selected)+e+t.length)%t.length];this.bench.select(s),this.updateComplete.then(()=>this.renderRoot.querySelector(`[id="tab-${s}"]`)?.focus()),i.preventDefault()}static{this.styles=[C,k`
      :host { display: grid; grid-template-columns: 1fr auto; grid-template-rows: auto 1fr; min-height: 0; }
      .chips { display: flex; gap: 2px; overflow-x: auto; padding: 6px 0 6px 8px; scrollbar-width: none; }
      .chips button { height: 26px; position: relative; }
      .note { width: 7px; height: 7px; border-radius: 50%; background: var(--warn); }
      .adds { padding: 6px 8px 6px 4px; }
      .adds select { height: 26px; width: 92px; }
      .form { grid-column: 1 / -1; overflow-y: auto; padding: 0 12px 12px; min-height: 0; }
      .head { display: flex; align-items: center; justify-content: space-between; gap: 8px; min-height: 30px; margin-bottom: 4px; }
      .form > p.quiet { margin: 8px 0 4px; }
      .verbs { display: flex; }
      .field { display: grid; grid-template-columns: minmax(86px, 132px) minmax(0, 1fr); align-items: center; gap: 4px 10px; min-height: 34px; }
      .field > label, .field > span:first-child { color: var(--quiet); overflow-wrap: anywhere; line-height: 1.2; }
      .field > input[type="text"], .field > select { width: 100%; max-width: 260px; }
      .field > button { justify-self: start; border-color: var(--line); }
      .field output { overflow-wrap: anywhere; }
      .field:has(.cells) { align-items: start; }
      .field:has(.cells) > label { padding-top: 6px; }
      .range { display: flex; align-items: center; gap: 6px; }
      .range input { width: 56px; }
      .inner { margin-left: 6px; padding-left: 10px; border-left: 2px solid var(--line); }
      .wrong { grid-column: 2; margin: 0 0 4px; color: var(--error); font-size: 12px; }
      .advice { margin: 0 0 8px; padding: 7px 10px; border-radius: 6px; background: var(--warn-ground); font-size: 12.5px; white-space: pre-line; }
      .cells { display: grid; gap: 6px; max-width: 260px; padding: 4px 0; }
      .grid { display: grid; gap: 1px; justify-content: start; border: 1px solid var(--line); background: var(--line); width: max-content; }
      .grid i { cursor: pointer; }
    `]}};var oi=[["alone","Picture"],["beside","Side by side"],["wipe","Wipe"],["difference","Difference ×4"]],ai=64,li=.0016,hi=.005,ci=6,le=class extends S{constructor(){super();this.middle={x:.5,y:.5};this.pointers=new Map;this.gesture=null;this.travelled=0;this.asked=null;this.scratch=document.createElement("canvas");this.watch=new ResizeObserver(([e])=>{this.width=e.contentRect.width,this.height=e.contentRect.height});this.zoom=1,this.compare="alone",this.wipe=.5,this.aiming=!1,this.at=null,this.width=this.height=0}static{this.properties={...S.properties,zoom:{state:!0},compare:{state:!0},wipe:{state:!0},aiming:{state:!0},at:{state:!0},width:{state:!0},height:{state:!0}}}firstUpdated(){this.watch.observe(this.renderRoot.querySelector(".stage")),this.canvas.addEventListener("wheel",e=>this.wheel(e),{passive:!1})}disconnectedCallback(){super.disconnectedCallback(),this.watch.disconnect()}get canvas(){return this.renderRoot.querySelector("canvas")}get shape(){let e=this.bench.document?.camera.sensor.shape;return Array.isArray(e)?[Number(e[0]),Number(e[1])]:this.bench.picture?.about.shape??[1,1]}get mode(){return this.bench.pinned?this.compare:"alone"}get paneWidth(){return this.mode==="beside"?this.width/2:this.width}get unit(){let[e,t]=this.shape;return this.zoom*Math.min((this.paneWidth-2)/t,(this.height-2)/e)}corner(){let[e,t]=this.shape;return{x:this.paneWidth/2-this.middle.x*t*this.unit,y:this.height/2-this.middle.y*e*this.unit}}pixelAt(e){let[t,s]=this.shape,n=this.corner(),o=Math.floor(((this.mode==="beside"?e.x%this.paneWidth:e.x)-n.x)/this.unit),a=Math.floor((e.y-n.y)/this.unit);return o>=0&&a>=0&&o<s&&a<t?{x:o,y:a}:null}zoomTo(e,t={x:this.paneWidth/2,y:this.height/2}){let[s,n]=this.shape,o=this.unit/this.zoom,a=Math.min(Math.max(e,1),Math.max(ai/o,1)),l=this.unit;this.zoom=a;let h=this.unit,c={x:t.x-this.paneWidth/2,y:t.y-this.height/2};this.middle={x:this.middle.x+(c.x/l-c.x/h)/n,y:this.middle.y+(c.y/l-c.y/h)/s},this.keepWithin()}pan(e,t){let[s,n]=this.shape;this.middle={x:this.middle.x-e/this.unit/n,y:this.middle.y-t/this.unit/s},this.keepWithin()}keepWithin(){let[e,t]=this.shape,s=(n,o,a)=>a<=o?.5:Math.min(Math.max(n,o/2/a),1-o/2/a);this.middle={x:s(this.middle.x,this.paneWidth,t*this.unit),y:s(this.middle.y,this.height,e*this.unit)},this.requestUpdate()}wheel(e){e.preventDefault();let t=this.placeOf(e);this.zoomTo(this.zoom*Math.exp(-e.deltaY*li*(e.deltaMode===1?20:1)),{x:t.x%this.paneWidth,y:t.y})}placeOf(e){let t=this.canvas.getBoundingClientRect();return{x:e.clientX-t.left,y:e.clientY-t.top}}down(e){if(e.button!==0)return;let t=this.placeOf(e);this.canvas.setPointerCapture(e.pointerId),this.pointers.set(e.pointerId,t),this.travelled=0,this.gesture=this.onWipe(t)?"wipe":"pan"}onWipe(e){return this.mode==="wipe"&&Math.abs(e.x-this.wipe*this.width)<14}move(e){let t=this.placeOf(e),s=this.pointers.get(e.pointerId);if(!s){this.point(this.pixelAt(t)),this.canvas.classList.toggle("wiping",this.onWipe(t));return}if(this.travelled+=Math.hypot(t.x-s.x,t.y-s.y),this.gesture==="wipe")this.wipe=Math.min(Math.max(t.x/this.width,0),1);else if(this.pointers.size===2){let n=[...this.pointers].find(([a])=>a!==e.pointerId)[1],o=a=>Math.max(Math.hypot(a.x-n.x,a.y-n.y),1);this.zoomTo(this.zoom*o(t)/o(s),{x:(t.x+n.x)/2%this.paneWidth,y:(t.y+n.y)/2})}else this.pan(t.x-s.x,t.y-s.y);this.pointers.set(e.pointerId,t)}up(e){if(!this.pointers.delete(e.pointerId)||this.travelled>4||this.gesture==="wipe")return;let s=this.pixelAt(this.placeOf(e));this.point(s),s&&this.aiming&&this.focusOn(s)}inPicture({x:e,y:t}){let[s,n]=this.shape,[o,a]=this.bench.picture?.about.shape??[s,n];return{x:Math.floor((e+.5)*a/n),y:Math.floor((t+.5)*o/s)}}focusOn(e){this.bench.act({do:"focus",...this.inPicture(e)})}point(e){e?.x===this.at?.x&&e?.y===this.at?.y||(this.at=e,e&&this.bench.picture&&!this.bench.picture.about.coarse&&this.bench.askValue(e.x,e.y))}key(e){let[t,s]=this.shape,n={ArrowLeft:[-1,0],ArrowRight:[1,0],ArrowUp:[0,-1],ArrowDown:[0,1]}[e.key];if(n&&!e.ctrlKey&&!e.metaKey){let o=e.shiftKey?10:1,a=this.at??{x:Math.floor(s/2),y:Math.floor(t/2)},l=Math.min(Math.max(a.x+n[0]*o,0),s-1),h=Math.min(Math.max(a.y+n[1]*o,0),t-1);this.point({x:l,y:h}),this.zoom>1&&(this.middle={x:(l+.5)/s,y:(h+.5)/t},this.keepWithin())}else if(e.key==="+"||e.key==="=")this.zoomTo(this.zoom*1.5);else if(e.key==="-")this.zoomTo(this.zoom/1.5);else if(e.key==="0")this.zoomTo(1);else if(e.key==="Enter"&&this.at)this.focusOn(this.at);else return;e.preventDefault()}askAgain(){let e=this.bench.picture?.about;e===this.asked||!e||e.coarse||(this.asked=e,this.at&&this.bench.askValue(this.at.x,this.at.y))}updated(){this.askAgain();let{canvas:e}=this,t=window.devicePixelRatio||1,[s,n]=[Math.round(this.width*t),Math.round(this.height*t)];(e.width!==s||e.height!==n)&&([e.width,e.height]=[s,n]);let o=e.getContext("2d");o.setTransform(1,0,0,1,0,0),o.clearRect(0,0,s,n),o.setTransform(t,0,0,t,0,0);let a=this.bench.picture?.bitmap;if(!a||!this.width)return;let l=this.bench.pinned;if(this.mode==="alone"||!l)this.put(o,a,0,this.width);else if(this.mode==="beside")this.put(o,l,0,this.paneWidth-1),this.put(o,a,this.paneWidth,this.paneWidth);else if(this.mode==="wipe"){let h=this.wipe*this.width;this.put(o,l,0,h,0),this.put(o,a,h,this.width-h,0),o.fillStyle="rgb(0 0 0 / 50%)",o.fillRect(h-2,0,4,this.height),o.fillStyle="#fff",o.fillRect(h-1,0,2,this.height),o.beginPath(),o.roundRect(h-4,this.height/2-16,8,32,4),o.fill(),o.strokeStyle="rgb(0 0 0 / 50%)",o.stroke()}else this.put(o,this.difference(a,l),0,this.width);this.at&&(this.unit>=ci||this.matchesFocus())&&this.outline(o,this.at)}matchesFocus(){return this.canvas.matches(":focus-visible")}put(e,t,s,n,o=s){let[a,l]=this.shape,h=this.corner();e.save(),e.beginPath(),e.rect(s,0,n,this.height),e.clip(),e.imageSmoothingEnabled=this.unit<2,e.imageSmoothingQuality="high",e.drawImage(t,o+h.x,h.y,l*this.unit,a*this.unit),e.restore()}difference(e,t){let{scratch:s}=this,[n,o]=this.shape;[s.width,s.height]=[o,n];let a=s.getContext("2d");a.drawImage(e,0,0,o,n),a.globalCompositeOperation="difference",a.drawImage(t,0,0,o,n),a.globalCompositeOperation="lighter";for(let l=0;l<2;l++)a.drawImage(s,0,0);return a.globalCompositeOperation="source-over",s}outline(e,{x:t,y:s}){let n=this.corner(),o=Math.max(this.unit,5),a=(o-this.unit)/2;for(let l of this.mode==="beside"?[0,this.paneWidth]:[0]){let h=[l+n.x+t*this.unit-a,n.y+s*this.unit-a];e.lineWidth=3,e.strokeStyle="rgb(0 0 0 / 60%)",e.strokeRect(...h,o,o),e.lineWidth=1.5,e.strokeStyle="#fff",e.strokeRect(...h,o,o)}}render(){let{bench:e}=this,t=e.picture?.about;return p`
      <div class="bar" role="toolbar" aria-label="Picture">
        <div class="group">
          <button class="icon" title="Smaller (−)" aria-label="Zoom out" ?disabled=${this.zoom<=1} @click=${()=>this.zoomTo(this.zoom/1.5)}>${$("minus")}</button>
          <button class="icon" title="Larger (+)" aria-label="Zoom in" @click=${()=>this.zoomTo(this.zoom*1.5)}>${$("plus")}</button>
          <button class="icon" title="All of it (0)" aria-label="The whole picture" @click=${()=>this.zoomTo(1)}>${$("whole")}</button>
        </div>
        <button aria-pressed=${this.aiming} aria-label="Click to focus" title="Click into the picture to focus there: the sensor moves" @click=${()=>this.aiming=!this.aiming}>${$("aim")}<span class="short">Focus</span><span class="long">Click to focus</span></button>
        ${this.exposure()}
        <label class="check" title="Noise of the sensor's electronics"><input type="checkbox" .checked=${e.document?.noise??!1}
          @change=${s=>e.set(["noise"],s.target.checked)}>Noise</label>
        <span class="spring"></span>
        <button aria-pressed=${e.pinned!==null} ?disabled=${!t} title="Keep this picture to compare others with" @click=${()=>this.pin()}>${$("pin")}${e.pinned?"Unpin":"Pin"}</button>
        ${e.pinned?p`<select aria-label="Compare with the pinned picture" .value=${this.compare}
          @change=${s=>this.compare=s.target.value}>
          ${oi.map(([s,n])=>p`<option value=${s} ?selected=${s===this.compare}>${n}</option>`)}</select>`:u}
      </div>
      <div class="stage">
        <canvas ?data-aiming=${this.aiming} tabindex="0" role="application"
          aria-label="The picture. Arrow keys move over its pixels, Enter focuses on one, plus, minus and 0 zoom."
          @pointerdown=${this.down} @pointermove=${this.move} @pointerup=${this.up} @pointercancel=${this.up}
          @pointerleave=${()=>this.point(null)} @dblclick=${()=>this.zoomTo(this.zoom>1?1:8)}
          @focus=${()=>this.requestUpdate()} @blur=${()=>this.requestUpdate()} @keydown=${this.key}></canvas>
        ${this.bench.without?p`<p class="without">${this.bench.without}</p>`:this.captions()}
        ${this.mode==="wipe"?p`<input type="range" class="wipe" min="0" max="1" step="0.01" aria-label="Place of the wipe" .value=${String(this.wipe)}
          @input=${s=>this.wipe=Number(s.target.value)}>`:u}
      </div>
      <div class="line">${this.reading()}<span class="spring"></span>${this.state()}</div>`}pin(){let e=!this.bench.pinned;this.bench.pin(e),e&&this.compare==="alone"&&(this.compare="wipe")}exposure(){let{bench:e}=this,t=e.document?.exposure??null,s=e.picture?.about.white??0;return p`<div class="group">
      <label class="check" title="Brightness is kept as it is now, so that it does not jump"><input type="checkbox" aria-label="Fix exposure" .checked=${t!==null}
        @change=${n=>e.set(["exposure"],n.target.checked?s:null)}><span class="long">Fix exposure</span><span class="short">Exposure</span></label>
      ${t===null?u:p`
        <button class="icon" aria-label="Darker" title="Darker" @click=${()=>e.set(["exposure"],t*Math.SQRT2)}>${$("minus")}</button>
        <button class="icon" aria-label="Brighter" title="Brighter" @click=${()=>e.set(["exposure"],t/Math.SQRT2)}>${$("plus")}</button>`}
    </div>`}captions(){let e=this.bench.picture?.about.psnr,t=this.bench.picture?.about.same?"the same":e==null?"":`PSNR ${v(e,3)} dB`;return this.mode==="alone"?u:this.mode==="difference"?p`<span class="caption left">difference ×4${t?` · ${t}`:""}</span>`:p`<span class="caption left">pinned</span><span class="caption right">now${t?` · ${t}`:""}</span>`}reading(){let{value:e}=this.bench;if(!this.at)return p`<span>${this.zoom>1?`${v(this.unit,3)} : 1`:"Point at the picture to read a pixel."}</span>`;let t=e&&e.x===this.at.x&&e.y===this.at.y,s=t?e.irradiance.map(o=>v(o,4)).join("  "):"…",n=t&&e.recorded?` · DN ${e.recorded.map(o=>v(o,6)).join("  ")}`:"";return p`<span role="status">column ${this.at.x}, row ${this.at.y} · ${s}${n}</span>`}state(){let e=this.bench.picture?.about;return e?p`
      ${e.missing>hi?p`<span class="missing" title="Rays that the light field does not hold: pixels are darker there than they would be">${v(100*e.missing,2)} % of the rays missing</span>`:u}
      <span>${this.shape[1]} × ${this.shape[0]}${e.coarse?", coarse":""} · ${v(e.took,3)} ms</span>`:u}static{this.styles=[C,k`
      :host { display: flex; flex-direction: column; min-height: 0; min-width: 0; container-type: inline-size; }
      .short { display: none; }
      .bar { display: flex; flex-wrap: wrap; align-items: center; gap: 2px 8px; padding: 6px 8px; }
      .group { display: flex; align-items: center; gap: 2px; }
      .spring { flex: 1; }
      .stage { position: relative; flex: 1; min-height: 0; background: var(--stage); overflow: hidden; }
      canvas { position: absolute; inset: 0; width: 100%; height: 100%; touch-action: none; cursor: crosshair; }
      canvas[data-aiming] { cursor: cell; }
      canvas:focus-visible { outline-offset: -2px; }
      .without { position: absolute; left: 10%; right: 10%; top: 40%; margin: 0; padding: 12px 16px; border-radius: 8px; background: var(--error-ground); white-space: pre-line; overflow-wrap: anywhere; }
      .caption { position: absolute; top: 8px; padding: 2px 8px; border-radius: 4px; background: rgb(0 0 0 / 62%); color: #fff; font-size: 12px; pointer-events: none; }
      .caption.left { left: 8px; } .caption.right { right: 8px; }
      /* The line itself is dragged; the slider is there for keys, and seen when they are on it. */
      .wipe { position: absolute; left: 0; right: 0; bottom: 6px; width: 100%; margin: 0; accent-color: var(--accent); pointer-events: none; opacity: 0; }
      .wipe:focus-visible { opacity: 1; }
      canvas.wiping { cursor: ew-resize; }
      .line { display: flex; gap: 14px; min-height: 26px; align-items: center; padding: 0 10px; font-size: 12px; color: var(--quiet); white-space: nowrap; overflow: hidden; }
      .line > span { overflow: hidden; text-overflow: ellipsis; white-space: pre; }
      .line > .missing { color: var(--warn-ink); }
      @container (max-width: 540px) { .short { display: inline; } .long { display: none; } .bar { gap: 2px; padding: 6px 4px; } button { padding: 0 6px; } label.check { gap: 5px; } .icon { width: 26px; padding: 0; } }
    `]}};function dt(r,i,e){let t=e.x(i),s=r.openings?.[0],n=r.half??(r.beam?1.08*r.beam:1/0),[o,a]=s&&r.length===0?[s[1],s[2]]:[r.decentre-n,r.decentre+n],l=Math.min(e.y(o),e.bottom),h=Math.max(e.y(a),e.top),c=r.half!==null,d={lens:di,block:ui,prism:pi,glass:mi,frosted:fi,mask:gi,sheet:ct}[r.drawn]??ct;return b`
    ${d(r,t,l,h,e,c)}
    ${(r.openings??[]).map(m=>bi(t+e.x(m[0])-e.x(r.z),m,r,e))}`}function di(r,i,e,t,{thick:s},n){let[o,a]=r.converging===!1?[s,.25*s]:[.12*s,s],l=2*a-o,h=(e+t)/2;return b`<path class="glass ${n?"":"open"}" d="M${i-o} ${e} Q${i-l} ${h} ${i-o} ${t}
    H${i+o} Q${i+l} ${h} ${i+o} ${e} Z"></path>`}function pi(r,i,e,t,{thick:s}){let n=r.towards??0,o=n===0?s:.05*s,[a,l]=n>=0?[s,o]:[o,s];return b`<path class="glass open" d="M${i-a} ${t}H${i+a}L${i+l} ${e}H${i-l}Z"></path>`}function ui(r,i,e,t,s,n){let o=Math.max(s.x(r.z+r.length)-s.x(r.z),s.thick);return b`<rect class="glass block ${n?"":"open"}" x=${i} y=${t} width=${o} height=${e-t}></rect>`}function mi(r,i,e,t,s,n){let o=(r.profile??[]).map(([c,d])=>[s.y(c),d]),a=o.map(([c,d])=>`${(i-s.thick*(.4+1.1*d)).toFixed(2)} ${c.toFixed(2)}`),l=o[0]?.[0]??e,h=o[o.length-1]?.[0]??t;return b`<path class="glass ${n?"":"open"}" d="M${i} ${l} L${a.join("L")} L${i} ${h} Z"></path>
    ${Oe(r,i-.4*s.thick,i,s,!0)}`}function fi(r,i,e,t,s,n){let o=.5*s.thick,a=(r.roughness??[]).map(([d,m])=>[s.y(d),m]),l=d=>a.reduce((m,f)=>Math.abs(f[0]-d)<Math.abs(m[0]-d)?f:m,a[0]??[0,1])[1],h=[],c=7;for(let d=t;d<e;d+=3){c=c*16807%2147483647;let m=s.thick*(.1+.9*l(d))*(.4+.6*c/2147483647);h.push(`${i} ${d.toFixed(1)}L${(i+m).toFixed(2)} ${Math.min(d+1.5,e).toFixed(1)}`)}return b`<path class="frost ${n?"":"open"}" d="M${i-o} ${t}L${h.join("L")}L${i} ${e}H${i-o}Z"></path>
    ${Oe(r,i-o,i,s,!0)}`}function gi(r,i,e,t,s,n){let o=Math.max(.35*s.thick,2);return b`${Oe(r,i-o,i+o,s,!1)}
    ${n?b`<rect class="outline" x=${i-o} y=${t} width=${2*o} height=${Math.max(e-t,0)}></rect>`:u}`}function Oe(r,i,e,t,s){return(r.shades??[]).map(([n,o,a])=>{let l=Math.max(t.y(o),t.top),h=Math.min(t.y(n),t.bottom);return h<=l||s&&a===1?u:b`<rect class="dark" x=${i} y=${l} width=${e-i} height=${h-l} fill-opacity=${1-a}></rect>`})}function ct(r,i,e,t){return b`<path class="sheet" d="M${i} ${t}V${e}"></path>`}function bi(r,[,i,e],t,s){let[n,o]=[Math.min(s.y(i),s.bottom),Math.max(s.y(e),s.top)],a=.05*(s.bottom-s.top),l=t.drawn==="block"&&t.half!==null?1.08*Math.max(t.half,t.beam??0):1/0,h=Math.max(s.y(t.decentre+l),s.top),c=Math.min(s.y(t.decentre-l),s.bottom);return b`
    <path class="rim heavy" d="M${r} ${o}V${Math.max(o-a,h)}M${r} ${n}V${Math.min(n+a,c)}"></path>
    <path class="rim" d="M${r} ${o}V${h}M${r} ${n}V${c}"></path>`}function pt(r,i,e){let t=r.borders.map(a=>Math.min(Math.max(e.y(a),e.top),e.bottom)),[s,n]=[Math.max(...t),Math.min(...t)],o=s-n>3*t.length?t:[s,n];return b`<path class="borders" d="M${i} ${n}V${s}${o.map(a=>`M${i-4} ${a}h8`).join("")}"></path>`}function ut(r,i,e){let t=e.x(i),s=Math.max(e.y(r.decentre+r.half),e.top),n=Math.min(e.y(r.decentre-r.half),e.bottom);return b`<rect class="sensor" x=${t} y=${s} width=${1.1*e.thick} height=${Math.max(n-s,1)} rx="1"></rect>`}var A={left:14,right:30,top:46,bottom:40},vi=7,$i=60,Ce=18,mt=1.35,yi=.06,wi=500,xi=500,ft=document.createElement("canvas").getContext("2d");function gt(r,i=!1){return ft.font=`${i?600:400} 11.5px system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", sans-serif`,ft.measureText(r).width}function ki({colour:r,words:i}){return r==="off axis"?"off the axis":i.replace(/ away$/,"")}var he=class extends S{constructor(){super();this.frame=null;this.keyTimer=0;this.watch=new ResizeObserver(([e])=>{this.width=Math.round(e.contentRect.width),this.height=Math.round(e.contentRect.height)});this.width=this.height=0,this.drag=this.hover=null}static{this.properties={...S.properties,width:{state:!0},height:{state:!0},drag:{state:!0},hover:{state:!0}}}connectedCallback(){super.connectedCallback(),this.watch.observe(this)}disconnectedCallback(){super.disconnectedCallback(),this.watch.disconnect()}placeOf(e){return this.drag?.which===e?this.drag.z:this.bench.partOf(e)?.z??0}parts(){return[...this.bench.side?.elements.map((t,s)=>s)??[],"sensor"]}lengthOf(e){return typeof e=="number"?this.bench.side?.elements[e]?.length??0:0}framed(e){let t={start:e.from,end:e.to+yi*(e.to-e.from),half:e.half},s=this.frame;return s&&this.drag||s&&t.start>=s.start&&t.end<=s.end&&t.half<=s.half&&(t.end-t.start)*mt>s.end-s.start&&t.half*mt>s.half?s:(this.frame=t,t)}scale(e){let{start:t,end:s,half:n}=this.framed(e),o=(this.width-A.left-A.right)/(s-t),a=(A.top+this.height-A.bottom)/2,l=(this.height-A.top-A.bottom)/2/n;return{x:h=>A.left+(h-t)*o,z:h=>t+(h-A.left)/o,y:h=>a-h*l,top:A.top,bottom:this.height-A.bottom,thick:Math.min(Math.max(.016*(s-t)*o,4),11)}}nearest(e){let t=this.bench.side;if(!t)return null;let s=this.scale(t),n=this.getBoundingClientRect(),o=e.clientX-n.left;if(e.clientY-n.top>s.bottom-4&&t.aperture&&Math.abs(s.x(this.placeOf("light field"))-o)<Ce)return{which:"light field",x:o};let l=null,h=e.pointerType==="mouse"?Ce:1.6*Ce;for(let c of this.parts()){let d=s.x(this.placeOf(c)),m=s.x(this.placeOf(c)+this.lengthOf(c)),f=o<d?d-o:o>m?o-m:0;(f<h||f===h&&c===this.bench.selected)&&([l,h]=[c,f])}return l===null?null:{which:l,x:o}}down(e){let t=this.nearest(e);if(!t||e.button!==0)return;this.bench.select(t.which);let s=this.placeOf(t.which);this.drag={which:t.which,grip:t.x-this.scale(this.bench.side).x(s),from:s,z:s,snaps:this.snapsOf(t.which),snap:null,moved:!1},e.currentTarget.setPointerCapture(e.pointerId),this.renderRoot.querySelector(`[data-part="${t.which}"]`)?.focus({preventScroll:!0,focusVisible:!1}),e.preventDefault()}move(e){if(!this.drag){this.hover=this.nearest(e)?.which??null;return}let t=this.scale(this.bench.side),s=Ee(this.frame.end-this.frame.start)/10,n=e.clientX-this.getBoundingClientRect().left-this.drag.grip,o=Math.round(t.z(n)/s)*s,a=e.altKey?null:this.snapNear(this.drag.snaps,n,t);a&&Math.abs(t.x(a.z)-n)<vi&&(o=a.z),!(o===this.drag.z&&this.drag.moved)&&(!this.drag.moved&&Math.abs(t.x(o)-t.x(this.drag.from))<2||(this.drag={...this.drag,z:o,snap:a,moved:!0},this.bench.set([...this.bench.whereOf(this.drag.which),"z"],_(o),!0)))}up(){let e=this.drag;if(!e)return;e.moved&&this.bench.set([...this.bench.whereOf(e.which),"z"],_(e.z));let t=()=>Math.abs((this.bench.partOf(e.which)?.z??NaN)-e.z)<1e-9,s=()=>{this.bench.removeEventListener("change",n),this.drag===e&&(this.drag=null)},n=()=>{t()&&s()};this.bench.addEventListener("change",n),!e.moved||t()?s():window.setTimeout(s,400)}snapsOf(e){return e==="sensor"?this.bench.side?.snaps??[]:(e==="light field"?this.bench.side?.aperture?.snaps:this.bench.side?.elements[e]?.snaps)??[]}snapNear(e,t,s){let n=null;for(let o of e)Math.abs(s.x(o.z)-t)<$i&&(!n||Math.abs(s.x(o.z)-t)<Math.abs(s.x(n.z)-t))&&(n=o);return n}key(e,t){let s={ArrowRight:1,ArrowUp:1,ArrowLeft:-1,ArrowDown:-1}[e.key];if(s&&!e.ctrlKey&&!e.metaKey){e.preventDefault();let n=Ee(this.frame.end-this.frame.start)*(e.shiftKey?10:e.altKey?.1:1),o=(this.drag?.which===t?this.drag.z:this.placeOf(t))+s*n,a=this.drag?.from??this.placeOf(t);this.drag={which:t,grip:0,from:a,z:Math.round(o/(n/10))*(n/10),snaps:[],snap:null,moved:!0},this.bench.set([...this.bench.whereOf(t),"z"],_(this.drag.z),!0),window.clearTimeout(this.keyTimer),this.keyTimer=window.setTimeout(()=>this.keysDone(),xi)}else if(e.key==="Enter")this.dispatchEvent(new CustomEvent("type-place",{bubbles:!0,composed:!0})),e.preventDefault();else if((e.key==="Delete"||e.key==="Backspace")&&typeof t=="number")this.bench.act({do:"remove",element:t}),e.preventDefault();else if(e.key==="Escape"&&this.drag){let{from:n}=this.drag;this.drag={...this.drag,z:n},this.keysDone()}}keysDone(){window.clearTimeout(this.keyTimer),this.drag&&this.up()}render(){let e=this.bench.side;if(!e||!this.width||!this.height)return u;let t=this.scale(e),s=this.drag||this.hover!==null?"grab":"";return p`
      <svg width=${this.width} height=${this.height} class=${s} role="group" aria-label="The camera from the side"
        @pointerdown=${this.down} @pointermove=${this.move} @pointerup=${this.up} @pointercancel=${this.up}
        @pointerleave=${()=>this.hover=null}>
        <path class="axis" d="M0 ${t.y(0)}H${this.width}"></path>
        ${this.drawAperture(e,t)}
        ${this.parts().map(n=>this.drawBack(n,t))}
        ${this.parts().map(n=>this.drawPart(n,e,t))}
        <g class="rays">${e.rays.map(n=>this.drawRays(n,t))}</g>
        ${this.drawSnap(t)}
        ${this.drawLabels(e,t)}
        ${this.drawDistances(e,t)}
      </svg>
      <ul class="legend">
        ${e.rays.filter(n=>this.width>wi||n.colour!=="off axis").map(n=>p`<li><i class="ray ${n.colour.replace(" ","-")}"></i>${ki(n)}</li>`)}
      </ul>`}drawRays(e,t){let s=new Map,n=[],o=Math.max(...e.paths.map(a=>a[a.length-1]?.[0]??-1/0));for(let a of e.paths){for(let c=1;c<a.length;c++){let[[d,m],[f,g,w]]=[a[c-1],a[c]],x=Math.ceil(w*5)/5;s.has(x)||s.set(x,[]),s.get(x).push(`M${t.x(d).toFixed(1)} ${t.y(m).toFixed(1)}L${t.x(f).toFixed(1)} ${t.y(g).toFixed(1)}`)}let[l,h]=a[a.length-1]??[o,0];l<o-1e-9&&n.push([t.x(l),t.y(h)])}return b`<g class="ray ${e.colour.replace(" ","-")}">
      ${[...s].map(([a,l])=>b`<path d=${l.join("")} stroke-opacity=${.25+.6*a}></path>`)}
      ${n.map(([a,l])=>b`<circle cx=${a} cy=${l} r="2"></circle>`)}
    </g>`}drawSnap(e){let t=this.drag?.snap;if(!t)return u;let s=this.drag.z===t.z,n=e.x(t.z),o=n>this.width-110;return b`<g class="snap ${s?"held":""}">
      <path d="M${n} ${e.top-6}V${e.bottom+4}"></path>
      <text x=${n+(o?-16:16)} y=${e.bottom-6} text-anchor=${o?"end":"start"}>${t.words}</text>
    </g>`}strip(e,t){let s=this.placeOf(e),n=e==="sensor"?1.1*t.thick:t.x(s+this.lengthOf(e))-t.x(s),o=n>0?6:9;return{x:t.x(s)-o,y:t.top-4,width:n+2*o,height:t.bottom-t.top+8}}drawBack(e,t){let s=this.bench.selected===e?"selected":this.hover===e?"hover":"";if(!s)return u;let{x:n,y:o,width:a,height:l}=this.strip(e,t);return b`<rect class="back ${s}" x=${n} y=${o} width=${a} height=${l} rx="5"></rect>`}drawPart(e,t,s){let n=this.placeOf(e),{x:o,y:a,width:l,height:h}=this.strip(e,s);return this.slider(e,b`<rect class="strip" x=${o} y=${a} width=${l} height=${h} rx="5"></rect>
      ${e==="sensor"?ut(t.sensor,n,s):dt({...t.elements[e],z:n},n,s)}`)}drawAperture(e,t){if(!e.aperture)return u;let s=this.placeOf("light field");if(s<this.frame.start||s>this.frame.end)return u;let n=t.x(s),o=this.bench.selected==="light field"?"selected":this.hover==="light field"?"hover":"";return this.slider("light field",b`<g class="aperture ${o}">${pt(e.aperture,n,t)}
      <path class="handle" d="M${n} ${t.bottom+1}l6 9h-12z"></path>
      <rect class="strip" x=${n-9} y=${t.bottom-2} width="18" height="14" rx="4"></rect></g>`)}slider(e,t){let s=this.placeOf(e),n=(this.frame.end-this.frame.start)*1e3;return b`<g class="part" data-part=${e} tabindex="0" role="slider"
        aria-label="${this.bench.partOf(e).label.join(", ")}: place on the axis" aria-orientation="horizontal"
        aria-valuemin=${(this.frame.start*1e3).toFixed(1)} aria-valuemax=${(this.frame.start*1e3+2*n).toFixed(1)}
        aria-valuenow=${(s*1e3).toFixed(3)} aria-valuetext=${B(s,6)}
        @keydown=${o=>this.key(o,e)}
        @focus=${()=>this.bench.select(e)} @blur=${()=>this.keysDone()}>${t}</g>`}drawLabels(e,t){let n=(this.bench.selected==="light field"&&e.aperture?["light field",...this.parts()]:this.parts()).map(a=>{let l=this.bench.partOf(a),h=this.lengthOf(a),c=this.placeOf(a),d=this.bench.selected===a,m=l.label[0]??"",f=d?`${m} · ${B(c,6)}`:m;return{which:a,x:t.x(c+h/2),words:f,chosen:d,notes:this.bench.notesOf(a).length}}).sort((a,l)=>a.x-l.x),o=[-1/0,-1/0,-1/0];return n.map(a=>{let l=gt(a.words,a.chosen)/2+5,h=Math.min(Math.max(a.x,l),this.width-l-(a.notes?14:0)),c=o.findIndex(m=>m<h-l);c<0&&(c=o.indexOf(Math.min(...o))),o[c]=h+l+(a.notes?14:0);let d=A.top-11-13*c;return b`<g class="label ${a.chosen?"chosen":""}" aria-hidden="true">
        <text x=${h} y=${d} text-anchor="middle">${a.words}</text>
        ${a.notes?this.drawBadge(a.which,h+l+4,d-4,a.notes):u}
      </g>`})}drawBadge(e,t,s,n){let o=this.bench.notesOf(e).map(a=>a.words).join(`
`);return b`<g class="badge" @pointerdown=${a=>{a.stopPropagation(),this.bench.select(e),this.dispatchEvent(new CustomEvent("show-notes",{bubbles:!0,composed:!0}))}}>
      <circle cx=${t} cy=${s} r="6.5"></circle>
      <text x=${t} y=${s+3.4} text-anchor="middle">${n>1?n:"!"}</text><title>${o}</title></g>`}drawDistances(e,t){let s=[...new Set(this.parts().map(h=>this.placeOf(h)))].sort((h,c)=>h-c),n=this.height-24,o=s.slice(1).map((h,c)=>{let[d,m]=[t.x(s[c]),t.x(h)],f=B(h-s[c],5),g=gt(f)+10;return b`<path d="M${d} ${n}H${m}"></path>
        ${m-d>g+4?b`<rect x=${(d+m-g)/2} y=${n-7} width=${g} height="14"></rect>
        <text x=${(d+m)/2} y=${n+4} text-anchor="middle">${f}</text>`:u}`}),a=s.map(h=>`M${t.x(h)} ${n-4}v8`).join(""),l=e.from<0&&s.length?b`<text class="scene" x="8" y=${n+4}>← scene</text>`:u;return b`<g class="distances" aria-hidden="true">${o}<path d=${a}></path>${l}</g>`}static{this.styles=[C,k`
      :host { display: block; position: relative; overflow: hidden; min-height: 150px; }
      svg { position: absolute; inset: 0; touch-action: pan-y; user-select: none; }
      svg.grab { cursor: ew-resize; }
      text { font-size: 11.5px; fill: var(--quiet); }
      .axis { stroke: var(--edge); stroke-width: 1; stroke-dasharray: 10 3 2 3; fill: none; }
      .rays { pointer-events: none; }
      g.ray path { fill: none; stroke-width: 1.15; stroke-linecap: round; }
      g.ray.focused path { stroke: var(--focused); } g.ray.focused circle { fill: var(--focused); }
      g.ray.near path { stroke: var(--near); } g.ray.near circle { fill: var(--near); }
      g.ray.far path { stroke: var(--far); } g.ray.far circle { fill: var(--far); }
      g.ray.off-axis path { stroke: var(--aside); } g.ray.off-axis circle { fill: var(--aside); }
      .part { outline: none; }
      .back.hover { fill: var(--hover); }
      .back.selected { fill: var(--chosen); }
      .strip { fill: transparent; }
      .part:focus-visible .strip { stroke: var(--accent); stroke-width: 2; }
      .glass { fill: var(--glass); stroke: var(--glass-edge); stroke-width: 1.2; fill-opacity: 0.85; }
      .glass.block { fill-opacity: 0.5; }
      .glass.open { stroke-dasharray: 4 3; }
      .frost { fill: var(--frost); stroke: var(--frost-edge); stroke-width: 0.8; }
      .frost.open { stroke-dasharray: 4 3; }
      .dark { fill: var(--ink); }
      .outline { fill: none; stroke: var(--ink); stroke-width: 0.8; }
      .sheet { stroke: var(--glass-edge); stroke-width: 2; fill: none; }
      .rim { stroke: var(--ink); stroke-width: 1; stroke-opacity: 0.5; fill: none; }
      .rim.heavy { stroke-width: 3; stroke-opacity: 1; }
      .sensor { fill: var(--quiet); stroke: var(--ink); stroke-width: 0.8; }
      .aperture .borders { stroke: var(--edge); stroke-width: 1.2; fill: none; }
      .aperture .handle { fill: var(--edge); }
      .aperture.hover .borders { stroke: var(--ink); } .aperture.hover .handle { fill: var(--ink); }
      .aperture.selected .borders { stroke: var(--accent); } .aperture.selected .handle { fill: var(--accent); }
      .label.chosen text { fill: var(--accent); font-weight: 600; }
      .badge { cursor: pointer; }
      .badge circle { fill: var(--warn); }
      .badge text { fill: var(--on-warn); font-size: 10px; font-weight: 700; }
      .snap path { stroke: var(--focused); stroke-width: 1; stroke-dasharray: 2 4; stroke-opacity: 0.6; }
      .snap text { fill: var(--focused); fill-opacity: 0.75; }
      .snap.held path { stroke-dasharray: none; stroke-width: 1.5; stroke-opacity: 1; }
      .snap.held text { fill-opacity: 1; font-weight: 600; }
      .distances path { stroke: var(--edge); fill: none; }
      .distances rect { fill: var(--ground); }
      .legend { position: absolute; left: 10px; right: 10px; bottom: 0; margin: 0; padding: 0; list-style: none; display: flex; justify-content: center; gap: 0 16px; white-space: nowrap; font-size: 11.5px; line-height: 16px; color: var(--quiet); pointer-events: none; }
      .legend i { display: inline-block; width: 14px; height: 2px; margin-right: 6px; vertical-align: 3px; border-radius: 1px; }
      i.focused { background: var(--focused); } i.near { background: var(--near); } i.far { background: var(--far); } i.off-axis { background: var(--aside); }
    `]}};var $t=[["explain","Explain"],["phase space","Phase space"],["point spread","Point spread"],["mtf","MTF"]],Le="phase space",Re=["point spread","mtf"],j=460,F=230,y={left:40,right:12,top:12,bottom:38};function yt({message:r,pictures:i}){switch(r.what){case"explain":return p`<pre>${r.words}</pre>`;case"point spread":return p`<p>${r.words}.</p><img class="point" src=${i[0]??""} alt="Picture of a point ${bt(r.distance)}, ${r.shape[1]} by ${r.shape[0]} pixels">`;case"mtf":return Ei(r.across,r.down,bt(r.distance));case"phase space":return r.frame?Ai(r.planes[0],r.frame,i[0]??""):p`<div class="planes">${r.planes.map((e,t)=>Si(e,i[t]??""))}</div>
        <p class="quiet">Each plane: places across it from left to right, slopes of the rays there upwards.</p>`}}function bt(r){return r===null?"infinitely far away":`${B(r,3)} away`}function Si(r,i){let e=r.title;return p`<figure><img src=${i} alt="Phase space: ${e}"><figcaption>${e}<br>
    <span class="quiet">${v(r.place[0]*1e3,3)} to ${v(r.place[1]*1e3,3)} mm · slopes ${v(r.slope[0],2)} to ${v(r.slope[1],2)}</span></figcaption></figure>`}function Ai(r,i,e){let t=1.2*F,[s,n,o,a]=[y.left+14,j-y.right,y.top,t-y.bottom],l=d=>s+(d-i.place[0])/(i.place[1]-i.place[0])*(n-s),h=d=>a-(d-i.slope[0])/(i.slope[1]-i.slope[0])*(a-o),c=i.place[1]-i.place[0]<.001?{of:1e6,unit:"µm"}:{of:1e3,unit:"mm"};return p`<figure><svg viewBox="0 0 ${j} ${t}" class="curves" role="img" aria-label="Phase space ${r.title}">
    <rect class="ground" x=${s} y=${o} width=${n-s} height=${a-o}></rect>
    <image href=${e} preserveAspectRatio="none" x=${l(r.place[0])} y=${h(r.slope[1])}
      width=${l(r.place[1])-l(r.place[0])} height=${h(r.slope[0])-h(r.slope[1])}></image>
    ${vt(i.place[0]*c.of,i.place[1]*c.of).map(d=>b`<path class="grid" d="M${l(d/c.of)} ${a}v4"></path>
      <text x=${l(d/c.of)} y=${a+16} text-anchor="middle">${v(d,3)}</text>`)}
    ${vt(...i.slope).map(d=>b`<path class="grid" d="M${s} ${h(d)}h-4"></path>
      <text x=${s-6} y=${h(d)+4} text-anchor="end">${v(d,3)}</text>`)}
    <text x=${(s+n)/2} y=${t-5} text-anchor="middle">place across the plane, ${c.unit}</text>
    <text transform="translate(11 ${(o+a)/2}) rotate(-90)" text-anchor="middle">slope</text></svg>
    <figcaption>${r.title}</figcaption></figure>`}function vt(r,i){let e=10**Math.floor(Math.log10(i-r)),t=[.2,.5,1,2].map(n=>n*e).find(n=>(i-r)/n<=6),s=Math.ceil(r/t-1e-9);return Array.from({length:Math.floor(i/t+1e-9)-s+1},(n,o)=>(s+o)*t)}function Ei(r,i,e){let t=Math.max(r[r.length-1]?.[0]??1,i[i.length-1]?.[0]??1);if(!(t>0))return p`<p>All light of a point ${e} falls into one pixel: its contrast is that of the pixel itself.</p>`;let s=c=>y.left+c/t*(j-y.left-y.right),n=c=>F-y.bottom-c*(F-y.top-y.bottom),o=c=>"M"+c.map(([d,m])=>`${s(d).toFixed(1)} ${n(m).toFixed(1)}`).join("L"),a=10**Math.floor(Math.log10(t)),l=a*(t<2.5*a?.5:t<5*a?1:2),h=Array.from({length:Math.floor(t/l+1e-9)+1},(c,d)=>d*l);return p`<svg viewBox="0 0 ${j} ${F}" class="curves" role="img" aria-label="Contrast over frequency of a point ${e}">
    ${[0,.25,.5,.75,1].map(c=>b`<path class="grid" d="M${y.left} ${n(c)}H${j-y.right}"></path>
      <text x=${y.left-6} y=${n(c)+4} text-anchor="end">${c}</text>`)}
    ${h.map(c=>b`<text x=${s(c)} y=${F-y.bottom+16} text-anchor="middle">${v(c,3)}</text>`)}
    <text x=${(y.left+j-y.right)/2} y=${F-5} text-anchor="middle">cycles per millimetre on the sensor, of a point ${e}</text>
    <path class="across" d=${o(r)}></path><path class="down" d=${o(i)}></path></svg>
    <p class="key"><i class="across"></i>across <i class="down"></i>down${Mi(r,i)?p`<span class="quiet"> (the same)</span>`:u}</p>`}function Mi(r,i){return r.length===i.length&&r.every(([,e],t)=>Math.abs(e-i[t][1])<.01)}var wt=k`
  .point { width: min(100%, 320px); image-rendering: pixelated; background: #000; }
  .planes { display: grid; grid-template-columns: repeat(auto-fill, minmax(170px, 1fr)); gap: 12px; margin-bottom: 10px; }
  .planes img { width: 100%; aspect-ratio: 4 / 3; object-fit: fill; background: #000; display: block; }
  figure { margin: 0; }
  figcaption { margin-top: 4px; font-size: 12px; line-height: 1.35; }
  .curves { width: 100%; max-width: 620px; display: block; }
  .curves .ground { fill: #000; }
  .curves text { font-size: 11px; fill: var(--quiet); }
  .curves path { fill: none; stroke-width: 1.8; }
  .curves path.grid { stroke: var(--line); stroke-width: 1; }
  .curves .across { stroke: var(--focused); }
  .curves .down { stroke: var(--near); stroke-dasharray: 5 3; }
  .key i { display: inline-block; width: 16px; height: 2px; vertical-align: 3px; margin-right: 5px; }
  .key i.across { background: var(--focused); }
  .key i.down { background: var(--near); margin-left: 14px; }
`;var _i=[["toml","Camera file (TOML)"],["python","Python program of this picture"],["png","Picture (PNG)"],["exr","Picture (OpenEXR, linear)"]],ze=class extends S{constructor(){super();this.distance="";this.plane="";this.underway=void 0;this.askNext=!1;this.askedFor="";this.askTimer=0;this.keyOutside=e=>{e.target===document.body&&this.key(e)};this.typePlace=()=>{this.beside="parts",this.updateComplete.then(()=>this.renderRoot.querySelector("vcc-bench-editor")?.typePlace())};this.showNotes=()=>{this.beside="parts"};this.key=e=>{if(!(e.ctrlKey||e.metaKey)||e.altKey)return;let t=e.key.toLowerCase();e.composedPath().some(n=>n instanceof HTMLElement&&n.matches("[data-edited]"))||t!=="z"&&t!=="y"||(e.preventDefault(),e.stopPropagation(),this.bench.act({do:t==="y"||e.shiftKey?"redo":"undo"}))};this.keepAnswer=()=>{if(this.underway!==void 0&&(this.bench.answer!==this.underway||this.bench.refused||!this.bench.open)&&(this.underway=void 0,this.askNext&&this.askAgain()),this.beside==="parts"||this.beside==="notes"||!this.bench.document)return;let e=this.beside+JSON.stringify(this.bench.document);if(e===this.askedFor)return;let t=this.askedFor==="",s=Y(this.bench.document.camera.sensor.z);!t&&Y(T(this.plane,null,"mm"))>s&&(this.plane=_(s)),this.askedFor=e,window.clearTimeout(this.askTimer),this.askTimer=window.setTimeout(()=>this.askAgain(),t?0:300)};this.beside="parts",this.film=null}static{this.properties={...S.properties,beside:{state:!0},film:{state:!0}}}connectedCallback(){super.connectedCallback(),this.bench.addEventListener("change",this.keepAnswer),this.addEventListener("keydown",this.key),this.bench.options.address&&window.addEventListener("keydown",this.keyOutside),this.addEventListener("type-place",this.typePlace),this.addEventListener("show-notes",this.showNotes)}disconnectedCallback(){super.disconnectedCallback(),this.bench.removeEventListener("change",this.keepAnswer),window.removeEventListener("keydown",this.keyOutside),window.clearTimeout(this.askTimer)}show(e){this.beside=e,this.askedFor="",this.keepAnswer()}askAgain(){if(this.beside==="parts"||this.beside==="notes"||(this.askNext=this.underway!==void 0,this.askNext))return;this.underway=this.bench.answer;let e=this.distance.trim(),t=this.plane.trim();Re.includes(this.beside)&&e?this.bench.question(this.beside,{distance:T(e,null,"m")}):this.beside===Le&&t?this.bench.question(this.beside,{z:T(t,null,"mm")}):this.bench.question(this.beside)}showPlane(e){this.plane=e.trim()&&T(e,this.plane,"mm"),this.bench.forgive(),this.askAgain()}planeField(){let e=this.bench.side?.sensor.z??0,t=Y(T(this.plane.trim(),null,"mm"));return p`<div class="distance"><label>plane at <input type="text" placeholder="each plane" .value=${this.plane}
        @change=${s=>this.showPlane(s.target.value)}></label>
      <input type="range" aria-label="Plane along the axis" min="0" max="1000" step="1" .value=${String(Number.isFinite(t)&&e>0?t/e*1e3:0)}
        aria-valuetext=${this.plane.trim()||"each plane"}
        @input=${s=>this.showPlane(_(Number((Number(s.target.value)/1e3*e).toPrecision(4))))}>
      <button ?disabled=${!this.plane.trim()} @click=${()=>this.showPlane("")}>Each plane</button></div>`}render(){let{bench:e}=this;return p`
      <header>
        <h1>vcc bench</h1>
        <div class="group">
          <button class="icon" title="Undo (Ctrl+Z)" aria-label="Undo" ?disabled=${!e.canUndo} @click=${()=>e.act({do:"undo"})}>${$("undo")}</button>
          <button class="icon" title="Redo (Ctrl+Shift+Z)" aria-label="Redo" ?disabled=${!e.canRedo} @click=${()=>e.act({do:"redo"})}>${$("redo")}</button>
        </div>
        ${e.side&&!e.canUndo&&!e.canRedo?p`<span class="quiet hint">Drag the sensor, or what stands before it.</span>`:u}
        <span class="spring"></span>
        ${e.parts?[this.opening(),this.keeping()]:u}
      </header>
      ${this.banner()}
      <section class="bench" aria-label="Optical bench">
        <vcc-bench-side .bench=${e}></vcc-bench-side>
      </section>
      <section class="picture" aria-label="Picture" aria-busy=${e.waiting||!e.picture}><vcc-bench-picture .bench=${e}></vcc-bench-picture></section>
      <section class="beside" aria-label="Parts and answers">
        ${this.tabs()}
        ${this.pane()}
      </section>
      <div class="toasts" role="status" aria-live="polite">${this.toasts()}</div>`}banner(){let{bench:e}=this;return e.open?u:p`<div class="banner" role="alert">${e.wasOpen?"The server is gone. What you see stays; the bench goes on when the server is back.":"Waiting for the server …"}</div>`}tabs(){let{bench:e}=this,t=[["parts","Parts"],["notes",e.notes.length?`Notes ${e.notes.length}`:"Notes"],...$t];return p`<div class="tabs" role="tablist" aria-label="Beside the picture" @keydown=${s=>{let n={ArrowRight:1,ArrowLeft:-1}[s.key];if(!n)return;let o=t.findIndex(([a])=>a===this.beside);this.show(t[(o+n+t.length)%t.length][0]),this.updateComplete.then(()=>this.renderRoot.querySelector('.tabs [aria-selected="true"]')?.focus())}}>
      ${t.map(([s,n])=>p`<button role="tab" id="beside-${s.replaceAll(" ","-")}" aria-selected=${this.beside===s} aria-controls="pane"
        tabindex=${this.beside===s?0:-1} @click=${()=>this.show(s)}>${n}</button>`)}
    </div>`}pane(){let{bench:e}=this,t=`beside-${this.beside.replaceAll(" ","-")}`;if(this.beside==="parts")return p`<div id="pane" class="pane" role="tabpanel" aria-labelledby=${t}><vcc-bench-editor .bench=${e}></vcc-bench-editor></div>`;if(this.beside==="notes")return p`<div id="pane" class="pane text" role="tabpanel" aria-labelledby=${t} tabindex="0">
        ${e.side?.words.map(n=>p`<p>${n}</p>`)}
        ${e.notes.length?u:p`<p class="quiet">Nothing to note: no ray misses, and nothing is too fine for the light field or the sensor.</p>`}
        ${e.notes.map(n=>p`<p class="advice">${n.element===null?u:p`<button class="link" @click=${()=>e.select(n.element)}>${e.partOf(n.element)?.label[0]??""}</button>`}${n.words}</p>`)}</div>`;let s=e.answer?.message.what===this.beside?e.answer:null;return p`<div id="pane" class="pane text answer" role="tabpanel" aria-labelledby=${t} tabindex="0" aria-busy=${!s}>
      ${Re.includes(this.beside)?p`<label class="distance">point at <input type="text" placeholder="in focus" .value=${this.distance}
        @change=${n=>{this.distance=n.target.value,this.askAgain()}}></label>`:u}
      ${this.beside===Le?this.planeField():u}
      ${s?yt(s):p`<p class="quiet">…</p>`}</div>`}toasts(){let{bench:e}=this,{progress:t,refused:s}=e;return p`
      ${s&&!this.saidAtField(s.where)?p`<div class="toast error"><span>${s.words}</span><button @click=${()=>e.forgive()}>Close</button></div>`:u}
      ${t?p`<div class="toast"><span>${t.words}</span><progress aria-label=${t.words} max=${t.total} value=${t.done}></progress></div>`:u}`}saidAtField(e){let{selected:t}=this.bench;if(!e||this.beside!=="parts")return!1;let s=this.bench.whereOf(t);return s.every((n,o)=>e[o]===n)&&e.length>s.length}opening(){let{bench:e}=this;return this.menu("Open",p`
      <button data-item @click=${t=>t.currentTarget.nextElementSibling.click()}>Camera file …</button>
      <input type="file" hidden accept=".toml" aria-label="Camera file" @change=${t=>{this.load(t.target)}}>
      ${e.parts.gallery.length?p`<hr>`:u}
      ${e.parts.gallery.map(t=>p`<button data-item @click=${()=>e.act({do:"load",gallery:t})}>${t}</button>`)}`)}async load(e){let t=e.files?.[0];t&&this.bench.act({do:"load",toml:await t.text()}),e.value=""}keeping(){return this.menu("Export",p`
      ${_i.map(([e,t])=>p`<button data-item @click=${()=>this.bench.export(e)}>${t}</button>`)}
      <hr><button data-item data-stays aria-expanded=${this.film!==null} @click=${()=>this.film=this.film===null?"z":null}>Film of a sweep …</button>
      ${this.film===null?u:this.filming(this.film)}`)}filming(e){let{bench:t}=this,{selected:s}=t,n=s==="light field"?t.document.aperture:s==="sensor"?t.document.camera.sensor:t.elements[s]??{},o=t.parts.kinds.find(g=>g.kind===n.kind),a=(s==="light field"?Pe:s==="sensor"?t.parts.sensor:o?.parameters??[]).filter(g=>g.takes.includes("number")&&N(String(n[g.name]??""))!==null),l=a.find(g=>g.name===e)??a[0],h=t.partOf(s)?.label[0]??"";if(!l)return p`<p class="quiet">${h} has no number to be swept.</p>`;let c=N(String(n[l.name])),d=l.name==="z"?.001/Y(`1 ${c.unit}`):.2*Math.abs(c.number),m=g=>`${v(c.number+g*d,5)} ${c.unit}`.trim(),f=(g,w)=>{let x=T(String(g.get(w)),n[l.name],"");return l.unit?x:Number(x)};return p`<form @submit=${g=>{g.preventDefault();let w=g.target,x=new FormData(w);t.export("film",{where:[...t.whereOf(s),l.name],from:f(x,"from"),to:f(x,"to"),frames:Number(x.get("frames")),format:x.get("format")}),w.closest("details").open=!1,this.film=null}}>
      <label>${h} <select name="parameter" @change=${g=>this.film=g.target.value}>
        ${a.map(g=>p`<option value=${g.name} ?selected=${g===l}>${g.name.replaceAll("_"," ")}</option>`)}</select></label>
      <label>from <input type="text" name="from" .value=${m(-1)}></label>
      <label>to <input type="text" name="to" .value=${m(1)}></label>
      <label>frames <input type="number" name="frames" min="2" max="200" value="30"></label>
      <label>as <select name="format"><option value="gif">GIF</option><option value="mp4">MP4</option></select></label>
      <button class="main">Make the film</button></form>`}menu(e,t){return p`<details class="menu" @keydown=${s=>{let n=s.currentTarget;s.key==="Escape"&&(n.open=!1,n.querySelector("summary").focus(),s.stopPropagation());let o={ArrowDown:1,ArrowUp:-1}[s.key];if(!o||s.target.matches("input, select"))return;s.preventDefault(),n.open=!0;let a=[...n.querySelectorAll("[data-item]")],l=a.indexOf(s.target);a[(l+o+a.length)%a.length]?.focus()}}
      @focusout=${s=>{let n=s.currentTarget;s.relatedTarget&&!n.contains(s.relatedTarget)&&(n.open=!1)}}
      @click=${s=>{let n=s.currentTarget,o=s.target.closest("[data-item]");o&&!o.matches("[data-stays]")&&!o.nextElementSibling?.matches("input")&&(n.open=!1)}}>
      <summary>${e}${$("down")}</summary><div class="items">${t}</div></details>`}static{this.styles=[C,wt,k`
      :host {
        color-scheme: var(--bench-scheme, light dark);
        --ground: light-dark(#fbfbf9, #17191b);
        --well: light-dark(#ffffff, #101213);
        --stage: light-dark(#ecece8, #0d0e0f);
        --line: light-dark(#e2e2dd, #2c3034);
        --edge: light-dark(#b5b5ae, #555b61);
        --ink: light-dark(#1c1e20, #e9e8e4);
        --quiet: light-dark(#5f6469, #a0a6ab);
        --faint: light-dark(#a9abad, #5e6469);
        --accent: light-dark(#005f99, #6cc0f5);
        --hover: light-dark(rgb(0 0 0 / 5%), rgb(255 255 255 / 7%));
        --chosen: light-dark(#e1eef7, #17354a);
        --warn: light-dark(#e0a100, #e6b422);
        --on-warn: #1c1e20;
        --warn-ink: light-dark(#7a5600, #e6b422);
        --warn-ground: light-dark(#fdf3d8, #36301c);
        --error: light-dark(#b3261e, #ff9d94);
        --error-ground: light-dark(#fdeceb, #3d1f1d);
        --glass: light-dark(#cfe6f5, #29475b);
        --glass-edge: light-dark(#4a7a9c, #7fb2d3);
        --frost: light-dark(#e4e4dd, #4b4d4b);
        --frost-edge: light-dark(#8a8a80, #a9a99c);
        --focused: light-dark(#0072b2, #56b4e9);
        --near: light-dark(#d55e00, #f0883e);
        --far: light-dark(#a5457f, #d98bb9);
        --aside: light-dark(#00805c, #2fc394);
        --arrow: url("data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' width='8' height='6' fill='none' stroke='%23808588' stroke-width='1.5'%3E%3Cpath d='m1 1 3 3 3-3'/%3E%3C/svg%3E");
        display: grid;
        position: relative;
        width: 100%;
        height: 100%;
        min-height: 0;
        background: var(--ground);
        text-align: start;
      }
      header { grid-area: header; display: flex; align-items: center; gap: 10px; padding: 0 8px 0 14px; height: 44px; border-bottom: 1px solid var(--line); position: relative; z-index: 3; }
      h1 { margin: 0; font-size: 13px; font-weight: 600; letter-spacing: -0.01em; }
      .group { display: flex; }
      .spring { flex: 1; }
      @container (max-width: 699px) { .hint { display: none; } }
      .bench { grid-area: bench; min-height: 0; min-width: 0; display: grid; border-bottom: 1px solid var(--line); }
      .picture { grid-area: picture; min-height: 0; min-width: 0; display: grid; border-left: var(--aside-border, 1px) solid var(--line); }
      .beside { grid-area: beside; min-height: 0; min-width: 0; display: flex; flex-direction: column; }
      .tabs { display: flex; gap: 2px; padding: 6px 8px 0; overflow-x: auto; scrollbar-width: none; flex: none; border-bottom: 1px solid var(--line); }
      .tabs button { border-radius: 6px 6px 0 0; height: 30px; color: var(--quiet); }
      .tabs button[aria-selected="true"] { background: none; color: var(--ink); font-weight: 600; box-shadow: inset 0 -2px var(--accent); }
      .pane { flex: 1; min-height: 0; display: grid; }
      .pane.text { display: block; overflow: auto; padding: 10px 14px; }
      .pane p { margin: 0 0 8px; }
      .pane pre { margin: 0; font: 11.5px/1.5 ui-monospace, "SF Mono", "DejaVu Sans Mono", monospace; white-space: pre-wrap; }
      .distance { display: flex; align-items: center; gap: 8px; margin-bottom: 10px; }
      .distance label { display: flex; align-items: center; gap: 8px; white-space: nowrap; }
      .distance input[type="text"] { width: 110px; }
      .distance input[type="range"] { flex: 1 1 60px; min-width: 60px; max-width: 260px; accent-color: var(--accent); }
      .advice { padding: 7px 10px; border-radius: 6px; background: var(--warn-ground); white-space: pre-line; }
      .link { height: auto; padding: 0 6px 0 0; font-weight: 600; text-decoration: underline; text-underline-offset: 2px; }
      .banner { grid-area: banner; padding: 7px 14px; background: var(--warn-ground); border-bottom: 1px solid var(--line); }
      .menu { position: relative; }
      .items { position: absolute; right: 0; top: 32px; min-width: 210px; max-height: 420px; overflow-y: auto; padding: 5px; background: var(--well); border: 1px solid var(--line); border-radius: 8px; box-shadow: 0 6px 24px rgb(0 0 0 / 14%); display: grid; }
      .items button { justify-content: start; }
      .items hr { width: 100%; border: 0; border-top: 1px solid var(--line); margin: 4px 0; }
      .items form { display: grid; gap: 6px; padding: 6px 9px; }
      .items form label { display: grid; grid-template-columns: 84px 1fr; align-items: center; overflow-wrap: anywhere; line-height: 1.2; }
      .items form select { border: 1px solid var(--line); background-color: var(--well); }
      .items .main { background: var(--accent); color: var(--ground); justify-content: center; }
      .toasts { position: absolute; left: 50%; bottom: 36px; translate: -50%; display: grid; gap: 8px; width: min(560px, 92%); pointer-events: none; z-index: 4; }
      .toast { display: flex; align-items: center; justify-content: space-between; gap: 12px; padding: 8px 8px 8px 14px; border-radius: 8px; border: 1px solid var(--line); background: var(--well); box-shadow: 0 6px 24px rgb(0 0 0 / 14%); pointer-events: auto; overflow-wrap: anywhere; }
      .toast.error { background: var(--error-ground); }
    `]}},He=class extends S{render(){return p`<vcc-bench-view .bench=${this.bench}></vcc-bench-view>`}static{this.styles=k`
    :host { display: block; width: 100%; height: 100%; container-type: size; overflow: auto; }
    vcc-bench-view { grid-template: "header header" auto "banner banner" auto "bench picture" minmax(180px, 44fr) "beside picture" 56fr / minmax(0, 46fr) minmax(0, 54fr); }
    @container (max-width: 699px) {
      vcc-bench-view { --aside-border: 0px; height: auto; min-height: 100%; grid-template: "header" auto "banner" auto "picture" min(112cqw, 480px) "bench" 230px "beside" minmax(320px, auto) / minmax(0, 1fr); }
    }
  `}};function xt(){I("vcc-bench-side",he),I("vcc-bench-picture",le),I("vcc-bench-editor",ae),I("vcc-bench-view",ze),I("vcc-bench",He)}var Ti="520px";function St(r,i,e={}){xt();let t=new ee(i,e),s=document.createElement("vcc-bench");return s.bench=t,r.append(s),t.start(),()=>{t.close(),s.remove()}}function Pi(r){let i=new URL("bench",window.location.href);i.protocol=i.protocol.replace("http","ws"),i.hash="";let e=new URLSearchParams(window.location.search).get("token");return i.search=e===null?"":`?token=${encodeURIComponent(e)}`,St(r,new te(i.href),{address:!0})}function Oi(){let{body:r}=document;return r.dataset.jpThemeLight==="true"||r.classList.contains("vscode-light")?"light":r.dataset.jpThemeLight==="false"||r.classList.contains("vscode-dark")?"dark":""}function Ci({model:r,el:i}){let e=document.createElement("div");e.style.cssText=`width: 100%; height: ${i.style.height||Ti}`,e.dataset.lmSuppressShortcuts="true";let t=Oi();return t&&e.style.setProperty("--bench-scheme",t),i.append(e),St(e,new ie(r))}var kt=document.querySelector("main[data-vcc-bench]");kt&&Pi(kt);var Bs={render:Ci};export{Bs as default,St as mount};
